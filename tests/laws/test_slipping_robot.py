"""The slipping robot and its sensors: Jacobians against differences, turning against what its wheels and gyro say."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusiond.errors import ConfigError
from fusiond.models import slipping_robot
from fusiond.models.catalogue import PROCESSES
from fusiond.models.sensors import body_gyro, wheel_pair
from fusiond.numerics.kernel import interpreted

SAID = {
    "track_m": 0.4, "yaw_acceleration_noise_rad_s2_sqrt_hz": 0.8, "push_slip_std_s": 0.1, "turn_slip_std": 0.05,
}  # fmt: skip
BARE = slipping_robot.describe(**SAID)
ROBOT = slipping_robot.describe(**SAID, gyro=True)
P = np.array(ROBOT.parameters)
PLACES = {slot.name: place for place, slot in enumerate(ROBOT.states)}


def state(**slots: float) -> np.ndarray:
    x = np.zeros(len(ROBOT.states))
    for name, value in slots.items():
        x[PLACES[name]] = value
    return x


def step(x: np.ndarray, u: float, dt_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    n = len(ROBOT.errors)
    after, F, B = np.zeros(n + 1), np.zeros((n, n)), np.zeros((n, 1))
    interpreted(slipping_robot.transition)(x, np.array([u]), dt_s, P, after, F, B)
    return after, F, B


def look(module, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    sensor = module.describe(ROBOT)
    at = np.array([PLACES[name] for name in sensor.reads])
    h, H = np.zeros(len(sensor.channels)), np.zeros((len(sensor.channels), len(ROBOT.errors)))
    assert interpreted(module.observe)(x, np.zeros(len(h)), at, np.array(sensor.parameters), h, H)
    return h, H


def moved(x: np.ndarray, dx: np.ndarray) -> np.ndarray:
    y = x.copy()
    interpreted(slipping_robot.add_error)(y, dx, P)
    return y


def between(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    dx = np.zeros(len(ROBOT.errors))
    interpreted(slipping_robot.error_between)(x, y, P, dx)
    return dx


def any_state(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    x = rng.uniform(-2.0, 2.0, len(ROBOT.states))
    x[2] = rng.choice([math.pi - 1e-7, -math.pi, rng.uniform(-math.pi, math.pi)])
    return x


@given(seed=st.integers(0, 10**9), dt_s=st.sampled_from([1e-3, 0.01, 0.05]))
@settings(max_examples=20)
def test_jacobians_are_derivatives(seed, dt_s):
    """F, B and both H against central differences on the manifold, also across the half turn."""
    x, eps = any_state(seed), 1e-6
    after, F, B = step(x, 0.7, dt_s)
    for j, e in enumerate(np.eye(len(ROBOT.errors)) * eps):
        ahead, behind = moved(x, e), moved(x, -e)
        by_state = between(step(behind, 0.7, dt_s)[0], step(ahead, 0.7, dt_s)[0]) / (2.0 * eps)
        assert F[:, j] == pytest.approx(by_state, abs=1e-8)
        for module in (wheel_pair, body_gyro):
            seen = (look(module, ahead)[0] - look(module, behind)[0]) / (2.0 * eps)
            assert look(module, x)[1][:, j] == pytest.approx(seen, abs=1e-8)
    pushed = between(step(x, 0.7 - eps, dt_s)[0], step(x, 0.7 + eps, dt_s)[0]) / (2.0 * eps)
    assert B[:, 0] == pytest.approx(pushed, abs=1e-8)
    assert after[-1] == 0.7


@given(seed=st.integers(0, 10**9))
def test_an_injected_error_is_the_one_found_between(seed):
    """x [+] dx = y and back; the heading stays on the circle, the felt acceleration has no error."""
    x, rng = any_state(seed), np.random.default_rng(seed + 1)
    dx = rng.uniform(-1.0, 1.0, len(ROBOT.errors))
    y = moved(x, dx)
    assert between(x, y) == pytest.approx(dx, abs=1e-12)
    assert -math.pi <= y[2] < math.pi
    assert y[-1] == x[-1]


@given(seed=st.integers(0, 10**9))
def test_the_body_turns_as_its_gyro_says(seed):
    """What the heading gains in a short while is the gyro's reading without its bias, and the derived yaw rate."""
    x = any_state(seed)
    x[PLACES["track_error"]] *= 0.1
    x[PLACES["turn_slip"]] *= 0.1
    rate = look(body_gyro, x)[0][0] - x[PLACES["gyro_bias"]]
    derived = np.zeros(3)
    interpreted(slipping_robot.derive)(x, P, derived)
    gained = between(x, step(x, 0.0, 1e-7)[0])[2] / 1e-7
    assert derived[0] == pytest.approx(rate, abs=1e-12)
    assert gained == pytest.approx(rate, abs=1e-5)


@pytest.mark.parametrize("mismatch", [-0.01, 0.0, 0.02])
@pytest.mark.parametrize("scrub", [-0.05, 0.1])
def test_wheels_and_body_agree_with_the_geometry(mismatch, scrub):
    """Wheels of sizes 1 -+ e / 2 on a track 1 / (1 - s) too wide: the two readings give back what the body does."""
    speed, rate, track_m = 0.8, 0.5, 0.4
    lever_m = 0.5 * track_m / (1.0 - scrub)
    left = (1.0 - 0.5 * mismatch) * (speed - lever_m * rate)
    right = (1.0 + 0.5 * mismatch) * (speed + lever_m * rate)
    turning = (right - left) / track_m
    x = state(speed=speed, wheel_turning=turning, wheel_mismatch=mismatch, track_error=scrub)
    assert look(body_gyro, x)[0][0] == pytest.approx(rate, rel=1e-9)
    # what unequal wheels do to the mean speed is left out: less than a millimetre a second here
    assert look(wheel_pair, x)[0] == pytest.approx([left, right], abs=0.0012)


def test_equal_wheels_are_read_exactly():
    x = state(speed=0.8, wheel_turning=2.0, push_slip=0.1, felt_acceleration=2.0)
    assert look(wheel_pair, x)[0] == pytest.approx([0.8 + 0.2 - 0.4, 0.8 + 0.2 + 0.4], rel=1e-12)


def test_what_encoders_see_does_not_depend_on_what_they_cannot_see():
    """H of the encoders is the same whatever the errors of wheels and track are thought to be."""
    _, thought = look(wheel_pair, state(speed=1.0, wheel_turning=3.0, wheel_mismatch=0.1, turn_slip=0.2))
    _, other = look(wheel_pair, state(speed=1.0, wheel_turning=3.0))
    assert np.array_equal(thought, other)
    assert not thought[:, [PLACES[name] for name in ("wheel_mismatch", "track_error", "turn_slip")]].any()


@pytest.mark.parametrize("dt_s", [1e-3, 0.01])
def test_what_dies_out_is_kept_alive(dt_s):
    """Stationary: decay and noise leave the configured spread of both slips, and that of the wheels' turning."""
    F = step(state(), 0.0, dt_s)[1]
    G, q = np.zeros((len(ROBOT.errors), 3)), np.zeros(3)
    interpreted(slipping_robot.noise)(state(), dt_s, P, G, q)
    Q = np.diag((G * q) @ G.T)
    spread = {"push_slip": 0.1**2, "turn_slip": 0.05**2, "wheel_turning": 0.8**2 * 0.5 / 2.0}
    for name, variance in spread.items():
        k = PLACES[name]
        assert F[k, k] ** 2 * variance + Q[k] == pytest.approx(variance, rel=1e-12)


def test_a_sensor_of_wheels_wants_a_robot_with_wheels():
    planar = PROCESSES["planar_robot"].describe(
        acceleration_noise_m_s2_sqrt_hz=1.0, yaw_acceleration_noise_rad_s2_sqrt_hz=1.0
    )
    with pytest.raises(ConfigError, match="slipping_robot"):
        wheel_pair.describe(planar)
    with pytest.raises(ConfigError, match="gyro = true"):
        body_gyro.describe(BARE)
