"""Seed 000's closed loops, as far as they need no filter."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from fusiond.simulation import closed_loop, rig
from fusiond.simulation.plants import PointState
from fusiond.simulation.registry import simulate

ONE_S = 1_000_000_000


def loop(make: Any, feedback: Any, goal_m: float, seed: int = 0) -> tuple[closed_loop.LoopRun, rig.PointRig]:
    moved = make(seed)
    law = closed_loop.PdLaw(goal_m, moved.plant.weight_n)
    return closed_loop.run(moved, law, feedback(moved.plant.start), 30 * ONE_S), moved


CASES = [(rig.minicar, 2.0), (rig.birotor, 0.75)]


@pytest.mark.parametrize(("make", "goal_m"), CASES)
def test_with_ideal_sensors_the_goal_is_reached(make: Any, goal_m: float) -> None:
    """Within 0.1 mm over the last 10 s; the force goes to 1 N from the weight, and no further."""
    run, moved = loop(make, lambda start: closed_loop.ideal(), goal_m)
    assert run.rms_from(goal_m, 10.0) < 1e-4
    pushed = np.abs(run.force_n - moved.plant.weight_n)
    assert pushed.max() == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_array_equal(run.fed_back, run.states[:, :2])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("make", "goal_m"), CASES)
def test_with_the_accelerometer_only_it_drifts_off_by_hundreds_of_metres(
    make: Any, goal_m: float, seed: int
) -> None:
    """The truth leaves the fed-back position by bias t^2 / 2 (436 m after 30 s) and 3 cm of noise."""
    run, moved = loop(make, closed_loop.accelerometer_only, goal_m, seed)
    t_s = run.t_ns / ONE_S
    drift = -0.5 * moved.acceleration_bias_m_s2 * t_s**2
    noise_std_m = np.sqrt(1e-4 * 1e-3 * t_s[-1] ** 3 / 3.0)
    np.testing.assert_allclose(run.states[:, 0] - run.fed_back[:, 0], drift, atol=5.0 * noise_std_m)
    assert 380.0 < run.states[-1, 0] - goal_m < 460.0
    assert 250.0 < run.rms_from(goal_m, 10.0) < 350.0


@pytest.mark.parametrize(("make", "goal_m"), CASES)
def test_with_the_ultrasonic_only_it_arrives_but_trembles(make: Any, goal_m: float) -> None:
    """1 to 10 mm RMS over the last 10 s; the differenced velocity errs by 0.47 m/s."""
    runs = [loop(make, closed_loop.ultrasonic_only, goal_m, seed)[0] for seed in range(4)]
    assert all(0.001 < run.rms_from(goal_m, 10.0) < 0.010 for run in runs)
    fresh = np.concatenate([(run.fed_back[:, 1] - run.states[:, 1])[15_000::30] for run in runs])
    assert np.std(fresh) == pytest.approx(np.sqrt(2.0) * 0.01 / 0.03, rel=0.1)


def test_the_fused_loop_sees_readings_and_never_the_truth() -> None:
    """An estimator from outside that does what `ultrasonic_only` does gives its bits, from readings alone."""
    told = rig.minicar(0)
    seen: list[tuple[int, float | None, float | None]] = []
    own = closed_loop.ultrasonic_only(told.plant.start)
    nothing = PointState(float("nan"), float("nan"), float("nan"))

    def estimator(t_ns: int, acceleration: float | None, ultrasonic: float | None) -> tuple[float, float]:
        seen.append((t_ns, acceleration, ultrasonic))
        return own(closed_loop.Moment(t_ns, nothing, acceleration, ultrasonic))

    run = closed_loop.run(told, closed_loop.PdLaw(2.0), closed_loop.fused(estimator), ONE_S)
    other = rig.minicar(0)
    same = closed_loop.run(
        other, closed_loop.PdLaw(2.0), closed_loop.ultrasonic_only(other.plant.start), ONE_S
    )
    np.testing.assert_array_equal(run.states, same.states)
    assert seen[0][1] is None
    assert [t for t, _, z in seen if z is not None] == list(range(0, ONE_S + 1, 30_000_000))
    assert all(later[0] - earlier[0] == 1_000_000 for earlier, later in pairwise(seen))


def test_a_rig_stepped_live_makes_the_readings_of_the_log() -> None:
    """The same forces, given one by one, end in the same bits."""
    run = simulate("birotor", 6, 2.0, inputs=True)
    live = rig.birotor(6)
    readings = live.begin()
    for force_n in run.of("applied")[1][:-1, 0].tolist():
        readings.extend(live.advance(force_n))
    assert readings == [r for r in run.readings if r.sensor in ("accelerometer", "ultrasonic")]
