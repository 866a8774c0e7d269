"""The linear-tyre single-track model: against the exact solution, the textbook's steady turn, and its own noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.stats import chi2

from fusiond.models import single_track
from fusiond.numerics.kernel import interpreted
from fusiond.simulation.streams import stream
from tools.pages.trials import configured

CAR = {
    "mass_kg": 1093.295, "yaw_inertia_kg_m2": 1791.6, "front_m": 1.1562, "rear_m": 1.42272,
    "stiffness_front_n_rad": 129700.0, "stiffness_rear_n_rad": 105400.0,
}  # fmt: skip
QUIET = {"specific_force_noise_m_s2_sqrt_hz": 0.0, "yaw_acceleration_noise_rad_s2_sqrt_hz": 0.0}


def step(x, u, dt_s):
    p = np.array(single_track.describe(**CAR, **QUIET).parameters)
    after = np.zeros(3)
    interpreted(single_track.transition)(x, u, dt_s, p, after, np.zeros((3, 3)), np.zeros((3, 2)))
    return after


def matrices(speed):
    """A and b of (vy, yaw rate)' = A x + b steering, from forces at the axles."""
    m, inertia, lf, lr, front, rear = CAR.values()
    slip = np.array([[1.0 / speed, lf / speed], [1.0 / speed, -lr / speed]])
    force = -np.diag([front, rear]) @ slip
    push = np.array([[1.0 / m, 1.0 / m], [lf / inertia, -lr / inertia]])
    A = push @ force
    A[0, 1] -= speed
    return A, push @ np.array([front, 0.0])


@pytest.mark.parametrize("speed", [10.0, 20.0, 40.0])
def test_a_step_is_the_exact_solution(speed):
    """Against the matrix exponential, inputs held: one step of 10 ms moves right to 3 %, ten of 1 ms to a permille."""
    A, b = matrices(speed)
    x, steering, dt_s = np.array([0.3, 0.2, 0.0]), 0.03, 0.01
    block = np.zeros((3, 3))
    block[:2, :2], block[:2, 2] = A, b * steering
    exact = (expm(block * dt_s) @ np.append(x[:2], 1.0))[:2]
    moved = np.abs(exact - x[:2]).max()
    assert np.abs(step(x, np.array([steering, speed]), dt_s)[:2] - exact).max() < 0.03 * moved
    fine = x
    for _ in range(10):
        fine = step(fine, np.array([steering, speed]), dt_s / 10.0)
    assert np.abs(fine[:2] - exact).max() < 1e-3 * moved


@pytest.mark.parametrize("speed", [10.0, 20.0, 40.0])
def test_a_steady_turn_is_the_textbooks(speed):
    """yaw rate = v steering / (L + K v^2), K = m (lr C_r - lf C_f) / (C_f C_r L), and ay = v yaw rate."""
    m, _, lf, lr, front, rear = CAR.values()
    wheelbase = lf + lr
    understeer = m * (lr * rear - lf * front) / (front * rear * wheelbase)
    x = np.zeros(3)
    for _ in range(1000):
        x = step(x, np.array([0.01, speed]), 0.01)
    assert x[1] == pytest.approx(speed * 0.01 / (wheelbase + understeer * speed**2), rel=1e-6)
    assert x[2] == pytest.approx(speed * x[1], rel=1e-6)


def test_on_its_own_model_the_filter_is_as_sure_as_it_may_be():
    """150 drives of two seconds with every noise of its own size: NEES of vy and yaw rate two-sided 99 %."""
    assembly = configured("single_track")
    engine, model = assembly.engine(), dict(assembly.config.model)
    runs, steps, dt_s = 150, 200, 0.01
    rng = stream(3, "single_track")
    std = assembly.config.initial.std
    x = np.array([std["vy_m_s"], std["yaw_rate_rad_s"]]) * rng.standard_normal((runs, 2))
    steering, speed = 0.02 * np.sin(np.arange(steps + 1) * 2.0 * np.pi / 125.0), 25.0
    A, b = matrices(speed)
    half = 0.5 * dt_s
    told, felt = np.zeros((runs, steps + 1, 2)), np.zeros((runs, steps + 1, 2))
    force = model["specific_force_noise_m_s2_sqrt_hz"] / np.sqrt(dt_s)
    turn = model["yaw_acceleration_noise_rad_s2_sqrt_hz"] * np.sqrt(dt_s)
    for k in range(steps + 1):
        told[:, k] = [steering[k], speed] + np.array([0.0005, 0.1]) * rng.standard_normal((runs, 2))
        if k == steps:
            break
        middle = x + half * (x @ A.T + b * steering[k])
        rate = middle @ A.T + b * steering[k]
        w = force * rng.standard_normal(runs)
        ay = rate[:, 0] + speed * middle[:, 1] + w
        x = x + dt_s * rate
        x[:, 0] += dt_s * w
        x[:, 1] += turn * rng.standard_normal(runs)
        felt[:, k + 1] = np.column_stack((ay, x[:, 1]))
        felt[:, k + 1] += np.array([0.025, 0.002]) * rng.standard_normal((runs, 2))
    total = 0.0
    for run in range(runs):
        engine.reset()
        engine.process(batch_of(engine.layout, told[run], felt[run]))
        e = engine.track[0]["x"][0][:2] - x[run]
        total += float(e @ np.linalg.solve(engine.covariance()[:2, :2], e))
    assert chi2.ppf(0.005, 2 * runs) < total < chi2.ppf(0.995, 2 * runs)


def batch_of(layout, told, felt):
    """Readings in the engine's own order: at every stamp the input, then, but for the first, the imu."""
    count = len(told)
    batch = np.zeros(2 * count - 1, layout.reading)
    stamps = np.arange(count, dtype=np.int64) * 10_000_000
    batch["length"] = 2
    batch["t_ns"][0], batch["z"][0, :2] = stamps[0], told[0]
    batch["sensor"][0] = layout.numbers["applied"]
    batch["t_ns"][1::2], batch["t_ns"][2::2] = stamps[1:], stamps[1:]
    batch["sensor"][1::2], batch["sensor"][2::2] = layout.numbers["applied"], layout.numbers["imu"]
    batch["z"][1::2, :2], batch["z"][2::2, :2] = told[1:], felt[1:]
    return batch
