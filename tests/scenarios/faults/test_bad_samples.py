"""Single bad samples change nothing; ten in a row do; what is no number never gets in."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.engine.records import HAS_SEQ
from fusiond.types import Health, Kind, Verdict
from tests.scenarios.faults.drive import lasting, scene


def between(log, layout, sensor, start_s, end_s):
    """Rows of a sensor's readings in an interval, end included."""
    mine = log["sensor"] == layout.numbers[sensor]
    return np.flatnonzero(mine & (log["t_ns"] >= lasting(start_s)) & (log["t_ns"] <= lasting(end_s)))


@pytest.mark.parametrize(
    ("name", "seconds", "fault", "sensor"),
    [
        ("minicar", 20.0, "ultrasonic.spike=0.5@10", "ultrasonic"),
        ("three_positions", 60.0, "y2.spike=1@30", "y2"),
        ("three_positions", 60.0, "y2.spike=-100@30", "y2"),
        ("reference_plant", 300.0, "y2.spike=10@150", "y2"),
        ("plane", 30.0, "gyro.spike=3@15", "gyro"),
        ("plane", 30.0, "gps.0.spike=707@15", "gps"),
        ("minicar", 20.0, "ultrasonic.nan@10+0.04", "ultrasonic"),
        ("minicar", 20.0, "accelerometer.nan@10+0.001", "accelerometer"),
    ],
)
def test_one_bad_sample_changes_no_flag(name, seconds, fault, sensor):
    """One spike, or one reading that is no number, is not used, and its sensor stays (F9, F13)."""
    run = scene(name).drive(seconds, [fault])
    assert not run.blamed(sensor), run.story()
    assert run.last(sensor).health is Health.HEALTHY


@pytest.mark.parametrize("seed", [0, 2])
@pytest.mark.parametrize(
    ("name", "seconds", "fault"),
    [
        ("reference_plant", 200.0, "y1.spike=-7@150"),
        ("reference_plant", 200.0, "y2.spike=12@150"),
        ("three_positions", 60.0, "y2.spike=1@30"),
        ("two_positions", 60.0, "y2.spike=1.5@30"),
    ],
)
def test_one_bad_sample_raises_no_suspicion(name, seconds, fault, seed):
    """GIVEN a spike of 7 to 15 deviations, an alarm with its own reading, THEN every sensor is healthy all along."""
    assert scene(name).drive(seconds, [fault], seed).story() == "nobody was ever blamed"


@pytest.mark.parametrize(
    ("name", "seconds", "fault", "sensor", "by_s", "well_s"),
    [
        ("minicar", 30.0, "ultrasonic.spike=0.5@10+0.3", "ultrasonic", 10.1, 20.4),
        ("three_positions", 60.0, "y2.spike=1@30+1", "y2", 30.2, 41.0),
        ("plane", 30.0, "gyro.spike=3@15+0.1", "gyro", 15.1, 25.1),
        ("minicar", 30.0, "ultrasonic.nan@10+0.3", "ultrasonic", 10.1, 20.3),
    ],
)
def test_ten_bad_samples_do_and_recovery_takes_no_ten_seconds(name, seconds, fault, sensor, by_s, well_s):
    """Ten in a row: flagged within 0.1 s (of 10 Hz: three readings), healthy 10 s after the last (F9)."""
    run = scene(name).drive(seconds, [fault])
    assert run.named(sensor).at_s <= by_s, run.story()
    assert run.last(sensor).health is Health.HEALTHY
    assert max(turn.at_s for turn in run.turns(sensor)) <= well_s


def test_a_single_jump_of_707_m_moves_the_estimate_by_less_than_a_metre():
    """One fix 707 m away: the position stays within 1.04 m of a run that never had it (F1)."""
    clean, run = scene("plane").drive(30.0), scene("plane").drive(30.0, ["gps.0.spike=707@15"])
    assert np.max(np.abs(run.value("x") - clean.value("x"))) <= 1.04


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("sensor", ["y2", "y3"])
def test_what_is_no_number_is_refused_and_the_output_stays_finite(value, sensor):
    """NaN and infinities: every one refused by name, garbage after three, every estimate finite (F13)."""

    def change(log, layout):
        log["z"][between(log, layout, sensor, 30.0, 35.0), 0] = value
        return log

    run = scene("three_positions").drive(60.0, change=change)
    rows = (run.reports["sensor"] == run.layout.numbers[sensor]) & (run.t_s >= 30.0) & (run.t_s <= 35.0)
    assert set(run.reports["verdict"][rows]) == {Verdict.NON_FINITE}
    assert np.isfinite(run.reports["x"]).all()
    assert np.isfinite(run.reports["std"]).all()
    assert run.named(sensor).kind is Kind.GARBAGE
    assert run.named(sensor).at_s <= 30.3
    assert run.last(sensor).health is Health.HEALTHY
    assert not run.blamed("y1")


@pytest.mark.parametrize("value", [1e300, -1e300, 1e12])
@pytest.mark.parametrize("sensor", ["y2", "y3"])
def test_what_is_too_large_to_be_measured_never_gets_in(sensor, value):
    """A number of more digits than instruments have is refused as out of range, one as well as ten; ten are garbage."""

    def change(log, layout):
        log["z"][between(log, layout, sensor, 20.0, 20.0), 0] = value
        log["z"][between(log, layout, sensor, 30.0, 31.0), 0] = value
        return log

    run = scene("three_positions").drive(60.0, change=change)
    assert np.sum(run.reports["verdict"] == Verdict.OUT_OF_RANGE) == 12
    assert run.named(sensor).kind is Kind.GARBAGE
    assert run.named(sensor).at_s >= 30.0
    assert run.last(sensor).health is Health.HEALTHY
    assert run.worst("position", 5.0) < 0.5


@pytest.mark.parametrize("size", [1e3, 1e5, 1e8])
def test_an_absurd_reading_leaves_nothing_behind(size):
    """Errors of up to a thousand million deviations, in a position and in an input: the estimate is where it was."""
    assert scene("three_positions").drive(60.0, [f"y2.bias={size:g}@30+5"]).worst("position", 5.0) < 0.5
    car = scene("minicar").drive(60.0, [f"accelerometer.bias={size / 10.0:g}@10+0.05"])
    assert np.isfinite(car.reports["x"]).all()
    assert car.worst("position", 59.0) < 0.05
    assert car.last("accelerometer").health is Health.HEALTHY
    assert car.last("ultrasonic").health is Health.HEALTHY


def test_the_size_of_a_bias_is_what_it_was_before_it_ended():
    """A bias of 1 km for 5 s: named with it, and still called that when the sensor is on probation."""
    run = scene("three_positions").drive(60.0, ["y2.bias=1000@30+5"])
    sizes = [turn.size for turn in run.turns("y2") if turn.health in (Health.EXCLUDED, Health.PROBATION)]
    assert len(sizes) >= 2
    assert np.allclose(sizes, 1000.0, atol=0.5)


@pytest.mark.parametrize("variance", [np.nan, np.inf, -1.0])
def test_a_covariance_that_is_none_is_refused(variance):
    """A reading whose own R is not a number, infinite or negative corrects nothing (F13, F18)."""

    def change(log, layout):
        rows = between(log, layout, "y2", 30.0, 30.0)
        log["R"][rows, 0, 0] = variance
        log["flags"][rows] |= 2
        return log

    run = scene("three_positions").drive(60.0, change=change)
    assert np.sum(run.reports["verdict"] == Verdict.BAD_COVARIANCE) == 1
    assert run.story() == "nobody was ever blamed"


@pytest.mark.parametrize("variance", [1e-9, 1e300])
def test_a_reading_that_says_it_is_perfect_or_knows_nothing_leaves_the_estimate_finite(variance):
    """Own variances of 1e-9 m^2 and of 1e300 m^2 for 10 s: finite, positive, and within a metre of the truth (F18)."""

    def change(log, layout):
        rows = between(log, layout, "y2", 30.0, 40.0)
        log["R"][rows, 0, 0] = variance
        log["flags"][rows] |= 2
        return log

    run = scene("three_positions").drive(60.0, change=change)
    assert np.isfinite(run.reports["x"]).all()
    assert (run.reports["std"] >= 0.0).all()
    assert run.worst("position", 30.0) < 1.0


def test_ten_thousand_readings_a_second_have_the_mean_of_one():
    """400 readings of one sensor 0.1 ms apart, 5 cm too large and too small in turn: their mean, no blame (F17)."""
    stage = scene("three_positions")
    truth = stage.simulation(60.0, 0).truth
    true_m = float(np.interp(lasting(30.0), truth.t_ns, truth.column("position")))

    def change(log, layout):
        row = between(log, layout, "y2", 30.0, 30.0)[0]
        burst = np.repeat(log[row : row + 1], 400)
        burst["t_ns"] += np.arange(400) * 100_000
        burst["z"][:, 0] = true_m + np.where(np.arange(400) % 2, 0.05, -0.05)
        return np.concatenate((log[:row], burst, log[row + 1 :]))

    run = stage.drive(60.0, change=change)
    last = np.flatnonzero(run.t_s < 30.05)[-1]
    assert set(run.reports["verdict"]) == {Verdict.USED}
    assert run.story() == "nobody was ever blamed"
    assert run.reports["std"][last, 0] == pytest.approx(0.1 / 20.0, rel=0.02)
    assert abs(run.value("position")[last] - true_m) < 0.02


def test_two_publishers_on_one_key_are_a_conflict_of_identity():
    """A second sender numbers its readings as y2 does, 3 m away: a conflict; y2 is garbage, later well."""

    def change(log, layout):
        log["flags"] |= HAS_SEQ
        for number in range(len(layout.sensors)):
            mine = np.flatnonzero(log["sensor"] == number)
            log["seq"][mine] = np.arange(len(mine))
        echoed = log[between(log, layout, "y2", 30.0, 33.0)].copy()
        echoed["z"][:, 0] += 3.0
        both = np.concatenate((log, echoed))
        return both[np.argsort(both["t_ns"], kind="stable")]

    run = scene("three_positions").drive(60.0, change=change)
    assert np.sum(run.reports["verdict"] == Verdict.CONFLICT) == 31
    verdict = run.named("y2")
    assert verdict.kind is Kind.GARBAGE, run.story()
    assert verdict.at_s <= 30.3
    assert run.last("y2").health is Health.HEALTHY
    assert not run.blamed("y1")


def test_what_is_sent_twice_is_no_conflict():
    """Every reading of y2 comes twice, word for word: duplicates, and nobody is blamed."""

    def change(log, layout):
        log["flags"] |= HAS_SEQ
        for number in range(len(layout.sensors)):
            mine = np.flatnonzero(log["sensor"] == number)
            log["seq"][mine] = np.arange(len(mine))
        both = np.concatenate((log, log[between(log, layout, "y2", 30.0, 33.0)]))
        return both[np.argsort(both["t_ns"], kind="stable")]

    run = scene("three_positions").drive(60.0, change=change)
    assert np.sum(run.reports["verdict"] == Verdict.DUPLICATE) == 31
    assert not run.blamed("y2"), run.story()
