"""The expected cost of control: the figures of the reference plant, and what a loop written apart really costs."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.assembly.expected_cost import expected_costs, sets_of
from fusiond.assembly.settled import Mover, events_of, settled_at_begin
from tools.pages.trials import configured

SETS = {
    frozenset({"y1", "y2"}): 1.34142, frozenset({"y1"}): 1.42942, frozenset({"y2"}): 1.58845, frozenset(): 2.15273,
}  # fmt: skip
DELAYS = {0: 1.42942, 1: 1.90517, 2: 2.07992, 3: 2.12876}


def costs(**control):
    assembly = configured("reference_plant_lqg", {"control": control})
    return {one.working: one.cost for one in expected_costs(assembly.resolved)}


def test_every_set_of_sensors_has_its_cost():
    """To 1e-5, with both sensors, each lost, and none."""
    found = costs()
    assert set(found) == set(SETS)
    for working, cost in SETS.items():
        assert found[working] == pytest.approx(cost, abs=1e-5)


@pytest.mark.parametrize("delay", DELAYS)
def test_a_late_command_has_its_cost(delay):
    """One sensor, the command 0 to 3 steps late, to 1e-5."""
    assert costs(delay_s=float(delay))[frozenset({"y1"})] == pytest.approx(DELAYS[delay], abs=1e-5)


def test_a_command_that_does_not_wait_is_made_of_the_first_reading_alone():
    """Without waits_for the command of a step knows y1, and of y2 only what it said before."""
    hasty = costs(waits_for=[])[frozenset({"y1", "y2"})]
    assert SETS[frozenset({"y1", "y2"})] + 0.01 < hasty < SETS[frozenset({"y1"})]


def test_an_error_that_grows_without_end_has_no_cost():
    found = {one.working: one.cost for one in expected_costs(configured("minicar_lqg").resolved)}
    assert found[frozenset({"ultrasonic"})] > 0.0
    assert found[frozenset()] is None


def test_many_sensors_are_lost_one_at_a_time():
    assert len(sets_of(["a", "b", "c"])) == 8
    assert len(sets_of([str(k) for k in range(9)])) == 10


def test_the_settled_covariance_is_where_the_recursion_rests():
    """Against four thousand periods of the mini car's filter, thirty accelerometer readings to one range."""
    resolved = configured("minicar_lqg", {"model": {"bias_noise_m_s2_sqrt_s": 1e-2}}).resolved
    events, period_s = events_of(resolved)
    mover = Mover(resolved)
    P = settled_at_begin(events, period_s, mover, 3)
    F, Q = mover.over(1e-3)
    walked = np.eye(3)
    for _ in range(4000):
        gain = walked[:, 0] / (walked[0, 0] + 1e-4)
        walked = walked - np.outer(gain, walked[0])
        for _ in range(30):
            walked = F @ walked @ F.T + Q
    assert np.allclose(P, walked, rtol=1e-6)


@pytest.mark.parametrize("delay", [0, 2])
def test_the_cost_is_what_a_loop_really_costs(delay):
    """400 loops of 500 steps in plain numpy, Kalman filter and regulator of the plan: J* within five deviations."""
    resolved = configured("reference_plant_lqg", {"control": {"delay_s": float(delay)}}).resolved
    plan, rng = resolved.law.plan, np.random.default_rng(11)
    A, B = plan.plant.bare
    P = settled_at_begin(*events_of(resolved), Mover(resolved), 3)
    H, R = np.array([[1.0, 0.0, 0.0]] * 2), np.diag([1.0, 2.0])
    M = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
    runs, steps = 400, 500
    x, seen, queue = np.zeros((runs, 3)), np.zeros((runs, 3)), np.zeros((runs, delay))
    spent = np.zeros((steps, runs))
    for k in range(steps):
        y = x @ H.T + rng.standard_normal((runs, 2)) @ np.sqrt(R)
        seen = seen + (y - seen @ H.T) @ M.T
        u = -(np.hstack([seen, queue]) @ plan.K.T)[:, 0]
        spent[k] = x[:, 0] ** 2 + 0.1 * u**2
        queue = np.hstack([queue, u[:, None]])
        acting, queue = queue[:, 0], queue[:, 1:]
        x = x @ A.T + np.outer(acting + np.sqrt(2.3) * rng.standard_normal(runs), B[:, 0])
        seen = seen @ A.T + np.outer(acting, B[:, 0])
    of_runs = spent[100:].mean(axis=0)
    J = {one.working: one.cost for one in expected_costs(resolved)}[frozenset({"y1", "y2"})]
    half = 5.0 * of_runs.std() / np.sqrt(runs)
    assert abs(of_runs.mean() - J) < half
    assert half < 0.05 * J
