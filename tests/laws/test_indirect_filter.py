"""Seed 003's indirect filter, equations (3) to (22): each misprint's resolution by a route that does not use it."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.assembly.trial import Trial
from fusiond.models import slipping_robot
from fusiond.numerics.kernel import interpreted
from fusiond.simulation.registry import simulate
from fusiond.simulation.square_robot import Pace, motion
from fusiond.simulation.tables import Reading
from tools.pages.trials import configured, records


def gain(P, H, Lambda, R):
    """(15), (18)."""
    return P @ H.T @ np.linalg.inv(H @ P @ H.T + Lambda @ R @ Lambda.T)


def system(seed=0, n=4, m=2):
    """A linear system in the letters of (11) and (12), with a sound prior."""
    rng = np.random.default_rng(seed)
    square = rng.standard_normal((n, n))
    return {
        "F": np.eye(n) + 0.1 * rng.standard_normal((n, n)), "H": rng.standard_normal((m, n)),
        "Gamma": rng.standard_normal((n, 2)), "Lambda": rng.standard_normal((m, m)),
        "Q": np.diag([0.3, 0.1]), "R": np.diag([0.2, 0.5]), "P": square @ square.T, "rng": rng,
    }  # fmt: skip


@pytest.fixture(scope="module")
def robot():
    return configured("square_robot")


# (4) to (9): one error, called dx and delta x in turn


@pytest.mark.parametrize("seed", range(5))
def test_the_error_of_the_nominal_trajectory_obeys_its_jacobian(robot, seed):
    """(6) has Dx where (3) says dx, (9) dx where it means dx': one error, f(x + dx) - f(x) = F dx + O(dx^2)."""
    trial, rng = Trial(robot.resolved), np.random.default_rng(seed)
    x = trial.start()
    dx = 0.01 * rng.standard_normal(10)
    nominal, F, _ = trial.move(x, np.array([0.5]), 0.05)
    rest = [
        np.abs(trial.error(nominal, trial.move(trial.shift(x, s * dx), np.array([0.5]), 0.05)[0]) - F @ (s * dx))
        for s in (1.0, 0.5)
    ]  # fmt: skip
    assert rest[0].max() < 0.02 * np.abs(F @ dx).max()
    assert rest[1].max() == pytest.approx(0.25 * rest[0].max(), rel=0.05)


def test_the_nominal_trajectory_has_the_true_input(robot):
    """(8) has u for u_d of (1): with the same input a nominal that is true stays true; another adds B (u - u_d)."""
    trial = Trial(robot.resolved)
    x, u_d, u = trial.start(), np.array([0.5]), np.array([0.6])
    true, _, B = trial.move(x, u_d, 0.01)
    assert trial.error(trial.move(x, u_d, 0.01)[0], true) == pytest.approx(np.zeros(10), abs=0.0)
    assert trial.error(true, trial.move(x, u, 0.01)[0]) == pytest.approx(B @ (u - u_d), abs=1e-12)


# (12), (15) to (18), (20)


def test_the_noise_of_a_reading_is_lambda_times_v():
    """(12), (15): twice the Lambda is four times the R."""
    s = system()
    twice = gain(s["P"], s["H"], 2.0 * np.eye(2), s["R"])
    assert twice == pytest.approx(gain(s["P"], s["H"], np.eye(2), 4.0 * s["R"]), rel=1e-12)


def test_both_covariances_are_of_their_own_errors():
    """(16) before, (17) after the reading: 200 000 draws have P- before and (20)'s P+ after, and not the other."""
    s = system()
    H, P, rng, draws = s["H"], s["P"], s["rng"], 200_000
    K = gain(P, H, s["Lambda"], s["R"])
    after = P - K @ H @ P
    dx = np.linalg.cholesky(P) @ rng.standard_normal((4, draws))
    dz = H @ dx + s["Lambda"] @ np.linalg.cholesky(s["R"]) @ rng.standard_normal((2, draws))
    # (19) with the prior estimate of the error at zero
    left = dx - K @ dz
    scale = np.sqrt(np.outer(np.diag(P), np.diag(P)))
    assert np.abs(dx @ dx.T / draws - P).max() < 0.02 * scale.max()
    assert np.abs(left @ left.T / draws - after).max() < 0.02 * np.diag(after).max()
    assert np.abs(left @ left.T / draws - P).max() > 0.5 * scale.max()


def test_the_short_form_is_josephs_where_the_gain_is_optimal():
    """(20): P - K H P = (I - K H) P (I - K H)' + K Lambda R Lambda' K', symmetric, for (18)'s gain and no other."""
    s = system()
    H, P, R = s["H"], s["P"], s["Lambda"] @ s["R"] @ s["Lambda"].T
    for share, same in ((1.0, True), (0.5, False)):
        K = share * gain(P, H, s["Lambda"], s["R"])
        rest = np.eye(4) - K @ H
        joseph = rest @ P @ rest.T + K @ R @ K.T
        assert (np.abs(P - K @ H @ P - joseph).max() < 1e-12 * np.abs(P).max()) == same


# (21): injection and reset, which the text never does


def recursion(model, readings, *, reset):
    """(18) to (22) about a nominal trajectory; with reset the error is put into it after every update, then zero.

    Args:
        model: move(x, u) -> x, F, Q; look(name, x) -> h, H, R; shift(x, dx).
    Returns: the estimate after every update, and the covariance.
    """
    x, dx, P, found, now = model.x0, np.zeros(len(model.P0)), model.P0, [], 0
    for reading in readings:
        if reading.t_ns > now:
            u_d = np.array(reading.z)
            x, F, Q = model.move(x, u_d)
            dx, P, now = F @ dx, F @ P @ F.T + Q, reading.t_ns
            continue
        if reading.sensor not in model.updating:
            continue
        h, H, R = model.look(reading.sensor, x)
        K = gain(P, H, np.eye(len(h)), R)
        dx, P = dx + K @ (np.array(reading.z) - h - H @ dx), P - K @ H @ P
        if reset:
            x, dx = model.shift(x, dx), np.zeros_like(dx)
        found.append(model.shift(x, dx))
    return np.array(found), P


class Dense:
    """A configuration's own models as plain matrices."""

    updating = ("encoders", "gyro")

    def __init__(self, assembly):
        self.trial = Trial(assembly.resolved)
        self.sensors = {sensor.name: sensor for sensor in assembly.resolved.sensors}
        self.x0, self.P0 = self.trial.initial(), np.diag(assembly.design[0]["d0"])
        self.shift = self.trial.shift

    def move(self, x, u):
        moved, F, _ = self.trial.move(x, u, 0.01)
        return moved, F, self.noise(x)

    def noise(self, x):
        n = len(self.P0)
        G, q, B = np.zeros((n, 3)), np.zeros(3), self.trial.move(x, np.zeros(1), 0.01)[2]
        interpreted(slipping_robot.noise)(x, 0.01, self.trial.parameters(), G, q)
        return (G * q) @ G.T + B @ self.sensors["accelerometer"].R @ B.T

    def look(self, name, x):
        h, H = self.trial.look(self.sensors[name], x)
        return h, H, self.sensors[name].R


class Linear:
    """A linear system, driven and read."""

    updating = ("y",)

    def __init__(self, seed):
        self.s = system(seed)
        self.x0, self.P0 = self.s["rng"].standard_normal(4), self.s["P"]

    def move(self, x, u):
        s = self.s
        return s["F"] @ x + s["Gamma"] @ u, s["F"], s["Gamma"] @ s["Q"] @ s["Gamma"].T

    def look(self, name, x):
        return self.s["H"] @ x, self.s["H"], self.s["R"]

    def shift(self, x, dx):
        return x + dx


@pytest.mark.parametrize("seed", range(5))
def test_on_a_linear_system_carrying_the_error_is_resetting_it(seed):
    """(21) carries the estimated error on; injected and reset after every update it is the same estimate to 1e-9."""
    rng = np.random.default_rng(100 + seed)
    readings = [
        Reading(t, name, tuple(rng.standard_normal(2))) for t in range(1, 40) for name in ("applied", "y")
    ]
    carried, P = recursion(Linear(seed), readings, reset=False)
    reset, same = recursion(Linear(seed), readings, reset=True)
    assert carried == pytest.approx(reset, rel=1e-9, abs=1e-9)
    assert np.array_equal(P, same)


@pytest.mark.parametrize("name", ["square_robot", "square_robot_gyro"])
def test_the_engine_is_the_indirect_filter_with_injection_and_reset(name):
    """Once round the square: state to 1e-8 and covariance to 1e-6 of the equations as resolved, in plain matrices."""
    assembly, run = configured(name), simulate(name, 3)
    expected, P = recursion(Dense(assembly), run.readings[1:], reset=True)
    engine = assembly.engine()
    given = records(engine.layout, run.readings[1:])
    reports = engine.process(given)
    updated = np.isin(
        reports["sensor"], [engine.layout.numbers[s] for s in Dense.updating if s in engine.layout.numbers]
    )
    assert reports["x"][updated] == pytest.approx(expected, abs=1e-8)
    scale = np.sqrt(np.outer(np.diag(P), np.diag(P)))
    assert np.abs(engine.covariance() - P).max() <= 1e-6 * scale.max()


def test_without_reset_the_robot_is_lost():
    """Carrying the error without injecting it linearises the turned robot at its old heading: metres off."""
    assembly, run = configured("square_robot"), simulate("square_robot", 3)
    carried, _ = recursion(Dense(assembly), run.readings[1:], reset=False)
    reset, _ = recursion(Dense(assembly), run.readings[1:], reset=True)
    assert np.hypot(*reset[-1, :2]) < 0.8
    assert np.hypot(*carried[-1, :2]) > 2.0


# the square


def test_the_printed_corners_are_no_square_and_the_resolved_ones_are():
    """(3,-3) and (0,-3) as printed make sides of 3, 6.7, 3 and 3 m; the robot's truth passes (3,3) and (3,0)."""
    printed = np.array([(0, 0), (0, 3), (3, -3), (0, -3), (0, 0)], dtype=float)
    sides = np.diff(printed, axis=0)
    assert np.hypot(*sides.T) == pytest.approx([3.0, 45.0**0.5, 3.0, 3.0])
    driven = motion(Pace(), 22_000_000_000)
    stops = [k for k in np.flatnonzero(np.diff(driven.phase)) if (driven.phase[k] - 1) % 6 == 2]
    corners = np.column_stack((driven.x_m, driven.y_m))[stops]
    assert corners == pytest.approx(np.array([(0, 3), (3, 3), (3, 0), (0, 0)], dtype=float), abs=1e-9)
