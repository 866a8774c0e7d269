"""Exclusion and return: what is left is a run that never had the sensor; who comes back too often waits longer."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.types import Health, Kind, ServiceHealth
from tests.scenarios.faults.drive import scene


@pytest.mark.parametrize(
    ("name", "seconds", "fault"),
    [
        ("three_positions", 60.0, "y2.bias=0.6@30"),
        ("three_positions", 60.0, "y2.drift=0.2@30"),
        ("three_positions", 60.0, "y2.stuck@30"),
        ("reference_plant", 200.0, "y2.bias=6@150"),
        ("reference_plant", 200.0, "y1.stuck@150"),
    ],
)
@pytest.mark.parametrize("seed", [0, 1])
def test_from_the_verdict_on_the_state_is_that_of_a_run_that_never_had_the_sensor(name, seconds, fault, seed):
    """Equal bytes of estimate and deviation, from the reading that brought the verdict to the end."""
    # GIVEN a run with a fault, and one whose log lacks the sensor
    stage, sensor = scene(name), fault.split(".")[0]
    log = stage.log(seconds, [fault], seed)
    run = stage.drive(seconds, [fault], seed)
    others = log["sensor"] != stage.layout.numbers[sensor]
    never = stage.run(log[others], stage.simulation(seconds, seed))

    # THEN their states are the same after every reading of the others since the verdict
    verdict = run.named(sensor)
    assert verdict.health is Health.EXCLUDED
    since = run.t_s[others] > verdict.at_s
    assert np.sum(since) > 30
    np.testing.assert_array_equal(run.reports["x"][others][since], never.reports["x"][since])
    np.testing.assert_array_equal(run.reports["std"][others][since], never.reports["std"][since])


def test_a_verdict_of_exclusion_is_not_taken_back_in_the_same_breath():
    """Readings from before the fault are no plea: the first health after the verdict is excluded, and stays so."""
    for name, seconds, fault, end_s in (
        ("reference_plant", 300.0, "y2.bias=6@150+60", 210.0),
        ("three_positions", 60.0, "y2.bias=0.6@30+10", 40.0),
    ):
        run = scene(name).drive(seconds, [fault])
        assert run.named("y2").health is Health.EXCLUDED
        assert run.when("y2", Health.PROBATION) > end_s
        assert run.last("y2").health is Health.HEALTHY


def test_a_second_fault_is_found_while_the_first_sensor_is_out():
    """y2 from 20 s, y3 from 25 s: both named, each in 1 s, by its size; y1 never is; both return."""
    run = scene("three_positions").drive(60.0, ["y2.bias=0.6@20+20", "y3.bias=0.6@25+20"])
    for sensor, start_s in (("y2", 20.0), ("y3", 25.0)):
        verdict = run.named(sensor)
        assert verdict.health is Health.EXCLUDED
        assert start_s <= verdict.at_s <= start_s + 1.0, run.story()
        assert abs(verdict.size - 0.6) <= 3.0 * verdict.std
        assert run.last(sensor).health is Health.HEALTHY
    assert not run.blamed("y1")
    assert run.worst("position", 20.0) < 0.5


@pytest.mark.parametrize("other_m", [0.6, -0.6])
def test_a_second_fault_ten_samples_after_the_first_excludes_both(other_m):
    """y3 errs from 29 s, y2 from 30 s: both out within 1 s; at the end the estimate is that of a run of y1 alone."""
    stage = scene("three_positions")
    faults = ["y3.bias=0.6@29", f"y2.bias={other_m}@30"]
    run = stage.drive(60.0, faults)
    for sensor, start_s in (("y3", 29.0), ("y2", 30.0)):
        assert run.named(sensor).health is Health.EXCLUDED
        assert run.named(sensor).at_s <= start_s + 1.0, run.story()
    log = stage.log(60.0, faults)
    alone = log["sensor"] == stage.layout.numbers["y1"]
    never = stage.run(log[alone], stage.simulation(60.0, 0))
    np.testing.assert_allclose(run.reports["x"][alone][-1], never.reports["x"][-1], rtol=1e-6)


def test_the_last_sensor_is_never_excluded():
    """All three err one after the other: the last is corrected, not excluded, and something goes on correcting."""
    faults = ["y1.bias=0.6@20", "y2.bias=-0.8@25", "y3.bias=1@30"]
    run = scene("three_positions").drive(60.0, faults)
    assert [run.last(s).health for s in ("y1", "y2", "y3")].count(Health.EXCLUDED) <= 2, run.story()
    excluded = run.reports["health"] == Health.EXCLUDED
    assert np.max(np.sum(excluded, axis=1)) <= 2
    assert run.service(20.5) <= {ServiceHealth.DEGRADED}


def test_a_glitch_common_to_all_excludes_nobody():
    """The same metre on all three lanes: the model is blamed, no sensor is (F16)."""
    run = scene("three_positions").drive(60.0, [f"y{k}.bias=1@30+10" for k in (1, 2, 3)])
    assert not any(run.blamed(s) for s in ("y1", "y2", "y3")), run.story()
    assert run.reports["model"].any()


def test_a_glitch_common_to_both_sensors_of_the_reference_plant_switches_to_neither():
    """Six deviations on y1 and y2 alike: neither is excluded (F16)."""
    run = scene("reference_plant").drive(300.0, ["y1.bias=6@150+60", "y2.bias=6@150+60"])
    assert not run.blamed("y1"), run.story()
    assert not run.blamed("y2"), run.story()


def test_who_relapses_waits_longer_every_time():
    """Five faults of 2 s: every return takes longer than the first, the fifth four times as long at least."""
    starts = (20, 35, 50, 65, 80)
    run = scene("three_positions").drive(120.0, [f"y2.bias=0.6@{start}+2" for start in starts])
    out = [run.when("y2", Health.EXCLUDED, start) for start in starts]
    waits = [
        run.when("y2", Health.HEALTHY, at_s) - start - 2 for at_s, start in zip(out, starts, strict=True)
    ]
    assert all(at_s <= start + 1.0 for at_s, start in zip(out, starts, strict=True)), run.story()
    assert all(wait >= waits[0] for wait in waits)
    assert waits[-1] >= 4.0 * waits[0]
    assert waits[0] <= 10.0
    assert run.last("y2").health is Health.HEALTHY


def test_its_own_estimate_is_as_sure_as_it_may_be_while_one_is_out():
    """Mean normalised error of 2 states over 12 runs between exclusion and return: 2 within 0.6."""
    stage, found = scene("three_positions"), []
    for seed in range(12):
        stage.drive(40.0, ["y2.bias=0.6@10"], seed)
        log = stage.log(40.0, ["y2.bias=0.6@10"], seed)
        stage.engine.reset()
        reports = stage.engine.process(log, covariances=True).copy()
        P = stage.engine.covariances[: len(log)].copy()
        truth = stage.simulation(40.0, seed).truth
        exact = np.column_stack(
            [np.interp(reports["t_ns"], truth.t_ns, truth.column(n)) for n in truth.names]
        )
        error = reports["x"] - exact[:, :2]
        late = np.flatnonzero((reports["t_ns"] > 12e9) & (reports["sensor"] == stage.layout.numbers["y3"]))
        solved = np.linalg.solve(P[late], error[late][:, :, None])[:, :, 0]
        found.append(float(np.mean(np.sum(error[late] * solved, axis=1))))
    assert np.mean(found) == pytest.approx(2.0, abs=0.6)


def test_two_at_once_are_told_from_the_model():
    """y2 and y3 jump together, apart from each other: whatever is said, y1 alone is right and is not excluded."""
    run = scene("three_positions").drive(60.0, ["y2.bias=0.6@30", "y3.bias=-0.6@30"])
    assert not run.blamed("y1"), run.story()
    assert {run.last(s).kind for s in ("y2", "y3")} <= {Kind.BIAS, Kind.NONE}


@pytest.mark.parametrize("fault", ["y1.stuck@20+3", "y1.nan@20+3"])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_only_sensor_of_a_plant_is_not_locked_out_for_ever(fault, seed):
    """Without it the estimate is soon too unsure to contradict anything: within 12 s of living again it is used."""
    run = scene("one_position").drive(60.0, [fault], seed)
    assert run.named("y1").health is Health.EXCLUDED
    assert run.last("y1").health is Health.HEALTHY
    assert 23.0 < run.when("y1", Health.HEALTHY, after_s=23.0) < 35.0
    assert run.worst("position", after_s=37.0) < 0.5


def test_the_only_sensor_of_a_plant_stays_out_while_it_repeats_itself():
    run = scene("one_position").drive(60.0, ["y1.stuck@20"])
    assert run.last("y1").health is not Health.HEALTHY
