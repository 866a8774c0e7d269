"""After a fault: nobody is blamed for what it left behind. A vehicle that only its receiver locates."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.types import Health, Kind
from tests.scenarios.faults.drive import scene

SEEDS = (0, 1, 2)
GUILTY = (Health.FAULTY, Health.EXCLUDED)


def named_after(run, end_s):
    """Sensors of which a verdict was given later than two seconds after a fault's end."""
    return [
        sensor.name
        for sensor in run.layout.sensors
        if any(t.health in GUILTY and t.at_s > end_s + 2.0 for t in run.turns(sensor.name))
    ]


@pytest.mark.parametrize("seed", SEEDS)
def test_an_error_in_both_channels_that_has_gone_leaves_no_other(seed):
    """5 m in x and y from 10 s to 20 s, taken off: healthy within 1 s of the end, nothing named thereafter."""
    run = scene("smooth_plane").drive(40.0, ["gps.bias=5@10+10"], seed)
    assert run.named("gps").kind is Kind.BIAS, run.story()
    assert run.when("gps", Health.HEALTHY, 20.0) <= 21.0, run.story()
    assert not named_after(run, 20.0), run.story()


@pytest.mark.parametrize("seed", SEEDS)
def test_the_end_of_a_scale_is_no_bias_and_nobody_elses_fault(seed):
    """30 % too much from 10 s to 20 s, a shift of tens of metres back at its end: the receiver has healed."""
    run = scene("smooth_plane").drive(35.0, ["gps.scale=1.3@10+10"], seed)
    assert run.when("gps", Health.HEALTHY, 20.0) <= 21.0, run.story()
    assert not named_after(run, 20.0), run.story()


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", ["stuck", "nan"])
def test_without_its_only_receiver_a_vehicle_goes_on_from_where_it_was(seed, kind):
    """10 s without a fix: the other sensors carry the position on within 5 m; the receiver is back within 12 s."""
    run = scene("smooth_plane").drive(45.0, [f"gps.{kind}@20+10"], seed)
    assert run.worst("x", 21.0, 30.0) < 5.0, run.story()
    assert run.worst("y", 21.0, 30.0) < 5.0, run.story()
    assert run.when("gps", Health.HEALTHY, 30.0) <= 42.0, run.story()


def test_a_change_of_kind_that_makes_matters_worse_is_undone():
    """While the vehicle turns evenly a gyro's bias looks like a scale of a fifth; that multiplies its noise by 5."""
    run = scene("smooth_plane").drive(40.0, ["gyro.bias=0.2@20+10"], 1)
    said = {turn.kind for turn in run.turns("gyro") if turn.health is Health.FAULTY}
    assert said == {Kind.BIAS}, run.story()
    assert run.when("gyro", Health.HEALTHY, 30.0) <= 31.0, run.story()
    assert run.last("gyro").health is Health.HEALTHY, run.story()
    assert not np.isin(run.health("gps"), GUILTY).any(), run.story()


@pytest.mark.parametrize("seed", SEEDS)
def test_an_error_to_be_compensated_that_is_not_known_is_excluded(seed):
    """0.05 m/s on a sensor of 0.1 m: a bias at first, taken off; as it errs on it is out, and the position is kept."""
    run = scene("compensated_position").drive(60.0, ["y1.drift=0.05@20+20"], seed)
    assert run.named("y1").health is Health.FAULTY, run.story()
    assert run.when("y1", Health.EXCLUDED) < 40.0, run.story()
    assert run.worst("position", 20.0, 45.0) < 0.3, run.story()
    assert run.when("y1", Health.HEALTHY, 40.0) <= 55.0, run.story()


def test_an_error_to_be_compensated_that_is_known_is_taken_off():
    """1 m: named once, its size within 3 deviations, used to the end of the fault."""
    run = scene("compensated_position").drive(60.0, ["y1.bias=1@20+20"], 0)
    verdict = run.named("y1")
    assert abs(verdict.size - 1.0) <= 3.0 * verdict.std, run.story()
    assert run.when("y1", Health.EXCLUDED) == np.inf, run.story()
    assert run.when("y1", Health.HEALTHY, 40.0) <= 42.0, run.story()
