"""A sensor that repeats its last value is stuck when it holds one for longer than ever while the machine moves on."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.types import Health, Kind, Verdict
from tests.scenarios.faults.drive import lasting, scene

HOLD = 5
"""Readings of y3 with one value: 10 Hz sent, 2 Hz measured."""


def holding(log, layout, stuck_from_s=np.inf, stuck_to_s=np.inf):
    """The log with y3 holding each fifth value, and one from a time to another."""
    mine = np.flatnonzero(log["sensor"] == layout.numbers["y3"])
    k, t_ns = np.arange(len(mine)), log["t_ns"][mine]
    first, last = (
        int(np.searchsorted(t_ns, lasting(s))) if np.isfinite(s) else len(k)
        for s in (stuck_from_s, stuck_to_s)
    )
    source = np.where(k < last, k // HOLD * HOLD, last + (k - last) // HOLD * HOLD)
    source[first:last] = first
    log["z"][mine] = log["z"][mine][source]
    return log


def standing(log, layout, held_from_s):
    """The machine stands at 1 m all the time; from a time on y3 says one value."""
    rng = np.random.default_rng(7)
    log["z"][:, 0] = 1.0 + 0.1 * rng.standard_normal(len(log))
    return holding(log, layout, held_from_s)


def test_values_held_as_ever_name_nobody():
    """GIVEN y3 sent at 10 Hz, new at 2 Hz, THEN four of five are refused as held, and in 120 s nobody is named."""
    run = scene("held_position").drive(120.0, change=holding)
    mine = run.reports["sensor"] == run.layout.numbers["y3"]
    assert np.mean(run.reports["verdict"][mine] == Verdict.HELD) > 0.75
    assert run.story() == "nobody was ever blamed"


def test_a_hold_three_times_as_long_as_ever_is_no_fault_yet():
    """GIVEN holds of four repetitions, WHEN one value is repeated twelve times on the move, THEN nobody is named."""
    run = scene("held_position").drive(60.0, change=lambda log, layout: holding(log, layout, 30.0, 31.25))
    assert run.story() == "nobody was ever blamed"


@pytest.mark.parametrize("seed", [0, 1])
def test_a_value_held_for_longer_while_the_machine_moves_on_is_stuck_and_its_sensor_comes_back(seed):
    """WHEN y3 holds one value from 30 to 40 s, THEN it is stuck at its 13th repetition, alone, once; later healthy."""
    run = scene("held_position").drive(
        80.0, seed=seed, change=lambda log, layout: holding(log, layout, 30.0, 40.0)
    )
    verdict = run.named("y3")
    assert verdict.kind is Kind.STUCK, run.story()
    assert verdict.at_s == pytest.approx(31.3), run.story()
    assert not run.blamed("y1"), run.story()
    assert not run.blamed("y2"), run.story()
    said = [turn.health for turn in run.turns("y3")]
    assert said == [Health.EXCLUDED, Health.PROBATION, Health.HEALTHY], run.story()


def test_a_value_held_by_a_standing_machine_names_nobody():
    """GIVEN a machine that stands, WHEN y3 holds one value for 90 s, a hundred and eighty times as long as ever."""
    run = scene("held_position").drive(120.0, change=lambda log, layout: standing(log, layout, 30.0))
    assert run.story() == "nobody was ever blamed"
