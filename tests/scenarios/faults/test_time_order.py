"""Late, doubled and misplaced readings around faults; and what a reset forgets."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.types import RESET, Health, ServiceHealth, Verdict
from tests.scenarios.faults.drive import lasting, scene


def late(log, start_s, end_s, by=3, seed=1):
    """The log with a tenth of the readings of an interval arriving after the `by` that follow them."""
    order = np.arange(len(log), dtype=float)
    chosen = np.random.default_rng(seed).random(len(log)) < 0.1
    order[chosen & (log["t_ns"] >= lasting(start_s)) & (log["t_ns"] < lasting(end_s))] += by + 0.5
    return log[np.argsort(order, kind="stable")]


@pytest.mark.parametrize(
    ("name", "seconds", "fault", "start_s", "end_s"),
    [
        ("three_positions", 60.0, "y2.bias=0.6@30+10", 31.0, 40.0),
        ("reference_plant", 300.0, "y2.bias=6@150+60", 155.0, 210.0),
        ("minicar", 20.0, "ultrasonic.bias=0.5@10+5", 10.2, 14.9),
        ("minicar", 20.0, "ultrasonic.bias=0.5@10+5", 0.0, 9.9),
    ],
)
def test_late_readings_during_a_fault_change_no_bit(name, seconds, fault, start_s, end_s):
    """A tenth of the readings arrive late while a sensor is out or corrected: the track ends in the same bytes."""
    stage = scene(name)
    log, simulation = stage.log(seconds, [fault]), stage.simulation(seconds, 0)
    shuffled = late(log, start_s, end_s)
    assert np.any(np.diff(shuffled["t_ns"]) < 0)
    assert stage.run(log, simulation).state == stage.run(shuffled, simulation).state


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_late_readings_around_the_verdict_end_in_the_same_estimate(seed):
    """Late readings all along, the verdict's own among them: the same estimate at the end, and nobody stays out."""
    stage = scene("three_positions")
    log, simulation = stage.log(60.0, ["y2.bias=0.6@30+10"], seed), stage.simulation(60.0, seed)
    plain, shuffled = stage.run(log, simulation), stage.run(late(log, 0.0, 60.0, seed=seed), simulation)
    np.testing.assert_array_equal(plain.reports["x"][-1], shuffled.reports["x"][-1])
    assert shuffled.last("y2").health is Health.HEALTHY, shuffled.story()


@pytest.mark.parametrize("sensor", ["y1", "y3"])
def test_a_sensor_that_has_returned_is_not_put_on_probation_again_by_late_readings(sensor):
    """Readings of the time around its return come late, in many orders: once healthy it stays so."""
    stage = scene("three_positions")
    log, simulation = stage.log(60.0, [f"{sensor}.bias=0.6@30+10"]), stage.simulation(60.0, 0)
    for seed in range(8):
        run = stage.run(late(log, 41.0, 50.0, by=4, seed=seed), simulation)
        assert run.last(sensor).health is Health.HEALTHY, run.story()


@pytest.mark.parametrize(
    ("name", "seconds", "fault"), [("plane", 30.0, "gps"), ("three_positions", 60.0, "y2")]
)
@pytest.mark.parametrize("count", [1, 10])
def test_stamps_of_long_ago_move_nothing(name, seconds, fault, count):
    """One or ten readings stamped 20 s too early, or zero: refused as too late, no jump of the state (F12)."""
    stage = scene(name)

    def change(log, layout):
        rows = np.flatnonzero(
            (log["sensor"] == layout.numbers[fault]) & (log["t_ns"] > lasting(0.8 * seconds))
        )
        log["t_ns"][rows[:count]] -= lasting(20.0)
        log["t_ns"][rows[count]] = 0
        return log

    clean, run = stage.drive(seconds), stage.drive(seconds, change=change)
    assert np.sum(run.reports["verdict"] == Verdict.TOO_LATE) == count + 1
    moved = np.abs(run.reports["x"][-1] - clean.reports["x"][-1])
    assert np.all(moved <= 3.0 * clean.reports["std"][-1])
    assert not run.blamed(fault) or run.named(fault).health is Health.SILENT


def test_a_reading_told_twice_counts_once():
    """Every reading of y2 sent twice: every second one is a duplicate, and the track ends in the same bytes (F15)."""
    stage = scene("three_positions")

    def twice(log, layout):
        return np.repeat(log, np.where(log["sensor"] == layout.numbers["y2"], 2, 1))

    plain, run = stage.drive(60.0), stage.drive(60.0, change=twice)
    assert run.state == plain.state
    assert np.sum(run.reports["verdict"] == Verdict.DUPLICATE) == len(run.reports) - len(plain.reports)


def test_a_reset_clears_faults_and_what_is_known_of_them():
    """A reset while y2 is excluded: everybody healthy at once, y2 used again; a later fault is found as if new."""
    stage = scene("reference_plant")

    def reset(log, layout):
        at = int(np.searchsorted(log["t_ns"], lasting(170.0)))
        event = np.zeros(1, layout.reading)
        event["t_ns"], event["sensor"] = log["t_ns"][at], RESET
        return np.concatenate((log[:at], event, log[at:]))

    run = stage.drive(300.0, ["y2.bias=8@150+20", "y2.bias=8@250"], change=reset)
    assert run.named("y2").health is Health.EXCLUDED
    assert run.named("y2").at_s < 160.0
    row = int(np.flatnonzero(run.reports["sensor"] == RESET)[0])
    assert not run.reports["health"][row:][run.t_s[row:] < 250.0].any(), run.story()
    rows = (run.reports["sensor"] == stage.layout.numbers["y2"]) & (run.t_s > 170.0) & (run.t_s < 250.0)
    assert set(run.reports["verdict"][rows]) == {Verdict.USED}
    assert 250.0 <= run.when("y2", Health.EXCLUDED, 250.0) <= 256.0


def test_an_engine_that_is_reset_is_a_fresh_one():
    """After faults of every sensor, reset() and the same log: the bytes of an engine that never ran before."""
    for name, seconds, faults in (
        ("three_positions", 20.0, ["y2.bias=0.6@5", "y3.nan@6", "y1.noise=5@7"]),
        ("minicar", 5.0, ["ultrasonic.bias=0.5@2", "accelerometer.stuck@4"]),
    ):
        stage = scene(name)
        assert stage.drive(seconds, faults).service() != {ServiceHealth.NOMINAL}
        again, fresh = stage.drive(seconds, faults), stage.assembly.engine()
        reports = fresh.process(stage.log(seconds, faults))
        assert fresh.state_sha256() == again.state
        np.testing.assert_array_equal(reports.view(np.uint8), again.reports.view(np.uint8))
        assert fresh.desk.tobytes() == stage.engine.desk.tobytes()
