"""The strapdown model and its sensors: quaternions against scipy, Jacobians against differences, motion as physics."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fusiond.assembly.assembly import assemble
from fusiond.config import Config
from fusiond.errors import ConfigError
from fusiond.models import strapdown
from fusiond.models.catalogue import SENSORS
from fusiond.numerics import quaternion
from fusiond.numerics.kernel import interpreted
from fusiond.simulation.flight import flight
from tools.pages.trials import configured, records

CONFIGS = Path(__file__).resolve().parents[2] / "configs"

SEEDS = st.integers(0, 10**9)
BODY = {"gyro_bias_noise_rad_s_sqrt_s": 1e-3, "accel_bias_noise_m_s2_sqrt_s": 1e-2}
MODELS = {
    "enu": strapdown.describe(frame="enu", **BODY),
    "ned": strapdown.describe(frame="ned", imu_mounting_rad=[0.3, -0.5, 2.0], **BODY),
}
LEVER = [0.4, -0.7, 0.3]
OBSERVED = {
    "attitude": ("attitude", {"angles": ["yaw", "roll", "pitch"], "offset_rad": [0.1, -0.2, 0.3]}),
    "compass": ("attitude", {"angles": ["yaw"]}),
    "barometer": ("barometer", {"z_is": "down", "origin_m": 300.0, "lever_m": LEVER}),
    "gnss_position": ("gnss_position", {"lever_m": LEVER}),
    "gnss_position.flat": ("gnss_position", {"lever_m": LEVER, "horizontal": True}),
    "gnss_velocity": ("gnss_velocity", {"lever_m": LEVER}),
    "gnss_velocity.flat": ("gnss_velocity", {"horizontal": True}),
    "magnetic_field": ("magnetic_field", {"field": [20.0, 1.0, 43.0], "mounting_rad": [0.2, 0.4, -2.0]}),
    "vehicle_course": ("vehicle_course", {"slow_m_s": 3.0, "offset_rad": 0.2}),
    "wheel_velocity": (
        "wheel_velocity",
        {"axes": ["x", "z", "y"], "scale": 1.1, "lever_m": LEVER, "mounting_rad": [0.1, 0.2, 0.5]},
    ),
    "wheel_speed": ("wheel_velocity", {"axes": ["x"]}),
    "zero_velocity": ("zero_velocity", {}),
    "zero_velocity.turning": ("zero_velocity", {"turning": False}),
}
"""Every sensor of the strapdown model, with and without what may be left out."""


def any_state(rng, scale=2.0):
    """A state with a quaternion of length one."""
    x = rng.uniform(-scale, scale, 19)
    x[12:16] /= np.linalg.norm(x[12:16])
    return x


def rotation(x):
    """scipy's rotation of the state's quaternion."""
    return Rotation.from_quat(x[[13, 14, 15, 12]])


def parameters_of(process):
    return np.array(process.parameters)


def moved(process, x, dx):
    y = x.copy()
    interpreted(strapdown.add_error)(y, dx, parameters_of(process))
    return y


def between(process, x, y):
    dx = np.zeros(15)
    interpreted(strapdown.error_between)(x, y, parameters_of(process), dx)
    return dx


def transition_of(process, x, u, dt_s):
    x_next, F, B = np.zeros(19), np.zeros((15, 15)), np.zeros((15, 6))
    interpreted(strapdown.transition)(x, u, dt_s, parameters_of(process), x_next, F, B)
    return x_next, F, B


def noise_of(process, x, dt_s):
    G, q = np.zeros((15, 6)), np.zeros(6)
    interpreted(strapdown.noise)(x, dt_s, parameters_of(process), G, q)
    return (G * q) @ G.T


def differences(function, count, step=1e-6):
    """Jacobian by central differences of a function of a small move (count,)."""
    columns = [function(step * e) / (2.0 * step) for e in np.eye(count)]
    return np.array(columns).T


def observed(case, x):
    kind, said = OBSERVED[case]
    sensor = SENSORS[kind].describe(MODELS["enu"], **said)
    names = [slot.name for slot in MODELS["enu"].states]
    at = np.array([names.index(name) for name in sensor.reads])
    m = len(sensor.channels)
    h, H = np.zeros(m), np.zeros((m, 15))
    assert interpreted(SENSORS[kind].observe)(x, np.ones(m), at, np.array(sensor.parameters), h, H)
    return h, H, sensor


@given(SEEDS, st.floats(1e-9, 3.0))
@settings(max_examples=25)
def test_turns_are_those_of_the_rotation_group(seed, angle_rad):
    """Turning in the body multiplies R from the right, in the world from the left; the turn between is undone by it."""
    rng = np.random.default_rng(seed)
    x = any_state(rng)
    axis = rng.standard_normal(3)
    theta = angle_rad * axis / np.linalg.norm(axis)
    in_body, in_world = np.zeros(19), x.copy()
    interpreted(quaternion.turn_in_body)(x, 12, *theta, in_body, 12)
    interpreted(quaternion.turn_in_world)(in_world, 12, *theta)
    turn = Rotation.from_rotvec(theta)
    assert np.allclose(rotation(in_body).as_matrix(), (rotation(x) * turn).as_matrix(), atol=1e-14)
    assert np.allclose(rotation(in_world).as_matrix(), (turn * rotation(x)).as_matrix(), atol=1e-14)
    assert np.allclose(interpreted(quaternion.rotation_of)(x, 12), rotation(x).as_matrix(), atol=1e-15)
    found = np.zeros(3)
    interpreted(quaternion.turn_between)(x, -in_world, 12, found, 0)
    assert found == pytest.approx(theta, rel=1e-9, abs=1e-15)


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
@settings(max_examples=25)
def test_angles_are_z_y_x(roll, pitch, yaw):
    R = Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()
    written = interpreted(quaternion.rotation_of)(quaternion.from_angles(roll, pitch, yaw), 0)
    assert np.allclose(written, R, atol=1e-14)
    rows = tuple(map(tuple, R))
    found = [interpreted(f)(rows) for f in (quaternion.roll_of, quaternion.pitch_of, quaternion.yaw_of)]
    assert found == pytest.approx([roll, pitch, yaw], abs=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-8, 1e-3, 9.9e-3, 1.1e-2, 0.49, 0.51, 2.0])
def test_series_and_functions_meet(angle):
    """Against their Taylor series, on both sides of every switch."""
    sums = [
        sum((-1) ** k * angle ** (2 * k) / math.factorial(2 * k + first) for k in range(20))
        for first in (1, 2, 3)
    ]
    functions = (quaternion.sinc, quaternion.half_versine, quaternion.sine_rest)
    assert [interpreted(f)(angle) for f in functions] == pytest.approx(sums, rel=1e-13)


@pytest.mark.parametrize("frame", MODELS)
@given(seed=SEEDS, dt_s=st.sampled_from([1e-3, 0.01, 0.2]))
@settings(max_examples=15)
def test_the_jacobians_are_the_derivatives_on_the_manifold(frame, seed, dt_s):
    """F by every error of the state, B by every input, through the mounting too."""
    process, rng = MODELS[frame], np.random.default_rng(seed)
    x, u = any_state(rng), rng.uniform(-3.0, 3.0, 6)
    _, F, B = transition_of(process, x, u, dt_s)

    def ends(change, *, by_input):
        def end(sign):
            start, held = (x, u + sign * change) if by_input else (moved(process, x, sign * change), u)
            return transition_of(process, start, held, dt_s)[0]

        return between(process, end(-1.0), end(1.0))

    assert pytest.approx(differences(lambda dx: ends(dx, by_input=False), 15), abs=2e-8) == F
    assert pytest.approx(differences(lambda du: ends(du, by_input=True), 6), abs=2e-8) == B


@pytest.mark.parametrize("case", OBSERVED)
@given(seed=SEEDS)
@settings(max_examples=15)
def test_a_sensors_jacobian_is_its_derivative_on_the_manifold(case, seed):
    x = any_state(np.random.default_rng(seed))
    R = rotation(x).as_matrix()
    if OBSERVED[case][0] == "attitude" and R[0, 0] ** 2 + R[1, 0] ** 2 < 0.01:
        return  # within 6 degrees of the pole the second derivative drowns the difference
    process = MODELS["enu"]
    _, H, sensor = observed(case, x)
    wraps = np.array([slot.name in sensor.wraps for slot in sensor.channels])

    def change(dx):
        apart = observed(case, moved(process, x, dx))[0] - observed(case, moved(process, x, -dx))[0]
        return np.where(wraps, (apart + math.pi) % (2.0 * math.pi) - math.pi, apart)

    assert pytest.approx(differences(change, 15), rel=1e-6, abs=2e-7) == H


def test_at_the_pole_of_the_angles_nothing_is_divided_by_zero():
    x = np.zeros(19)
    x[12:16] = quaternion.from_angles(0.3, math.pi / 2.0, 0.2)
    h, H, _ = observed("attitude", x)
    assert np.isfinite(h).all()
    assert np.isfinite(H).all()


@pytest.mark.parametrize(("frame", "up"), [("enu", 1.0), ("ned", -1.0)])
def test_at_rest_it_stays_and_let_go_it_falls(frame, up):
    """The specific force at rest points up, through whatever mounting; without any the body falls g t^2 / 2."""
    process = MODELS[frame]
    M = np.array(process.parameters[3:12]).reshape(3, 3)
    x = np.array([*process.origin])
    resting = np.concatenate((np.zeros(3), M.T @ np.array([0.0, 0.0, up * 9.80665])))
    assert transition_of(process, x, resting, 2.0)[0] == pytest.approx(x, abs=1e-12)
    fallen = transition_of(process, x, np.zeros(6), 2.0)[0]
    assert fallen[[2, 5]] == pytest.approx([-up * 2.0 * 9.80665, -up * 2.0 * 9.80665], rel=1e-12)


def circling(process, turn_rad, steps, speed=10.0, omega=0.2):
    """The state after part of a level circle at constant rate and force, begun at the origin along x."""
    x = np.array([*process.origin])
    x[3] = speed
    u = np.array([0.0, 0.0, omega, 0.0, omega * speed, 9.80665])
    for _ in range(steps):
        x = transition_of(process, x, u, turn_rad / omega / steps)[0]
    return x


def test_a_banked_turn_closes_its_circle():
    """Radius 50 m at 10 m/s: back where it began to 0.1 mm; a quarter ends on the circle, better as dt^2."""
    process = MODELS["enu"]
    whole = circling(process, 2.0 * math.pi, 3000)
    assert np.hypot(whole[0], whole[1]) < 1e-4
    assert whole[3:6] == pytest.approx([10.0, 0.0, 0.0], abs=1e-9)
    assert whole[12:16] == pytest.approx([-1.0, 0.0, 0.0, 0.0], abs=1e-9)

    def quarter_m(steps):
        x = circling(process, 0.5 * math.pi, steps)
        return np.hypot(x[0] - 50.0, x[1] - 50.0)

    assert quarter_m(100) < 0.01
    assert quarter_m(200) == pytest.approx(quarter_m(100) / 4.0, rel=0.01)


@given(SEEDS)
@settings(max_examples=10)
def test_an_antenna_moves_as_its_velocity_says(seed):
    """The derivative of gnss_position along the motion is gnss_velocity, lever arm and gyro bias included."""
    process, rng = MODELS["enu"], np.random.default_rng(seed)
    x, u, dt_s = any_state(rng, 1.0), rng.uniform(-1.0, 1.0, 6), 1e-4
    later = transition_of(process, x, u, dt_s)[0]
    x[16:19] = later[16:19]
    mean = 0.5 * (observed("gnss_velocity", x)[0] + observed("gnss_velocity", later)[0])
    moving = (observed("gnss_position", later)[0] - observed("gnss_position", x)[0]) / dt_s
    assert moving == pytest.approx(mean, abs=1e-6)


@given(SEEDS)
@settings(max_examples=10)
def test_wheels_and_antenna_agree(seed):
    """The wheels' velocity at a lever is the antenna's at the same lever, seen from the base, times the scale."""
    x = any_state(np.random.default_rng(seed))
    base = rotation(x) * Rotation.from_euler("ZYX", [0.5, 0.2, 0.1])
    across = base.inv().apply(observed("gnss_velocity", x)[0])
    assert observed("wheel_velocity", x)[0] == pytest.approx(1.1 * across[[0, 2, 1]], abs=1e-12)


def test_ten_small_steps_make_the_covariance_of_one_long_step():
    """F and the bias noise compose: ten times 10 ms against 100 ms, within the order left out (dt^3 of the walk)."""
    process, x = MODELS["enu"], any_state(np.random.default_rng(3))
    u = np.array([0.1, -0.2, 0.3, 1.0, 2.0, 9.0])
    P = np.zeros((15, 15))
    y = x
    for _ in range(10):
        y, F, _ = transition_of(process, y, u, 0.01)
        P = F @ P @ F.T + noise_of(process, y, 0.01)
    walked = [*range(6, 12)]
    assert np.diag(P)[walked] == pytest.approx(np.diag(noise_of(process, x, 0.1))[walked], rel=1e-12)
    assert np.diag(P)[12:] == pytest.approx(np.full(3, 1e-6 * 0.1**3 / 3.0), rel=0.2)


def test_an_exact_imu_flies_the_simulators_path():
    """20 s of exact 100 Hz means, nothing else heard: within 1 cm, 1 mm/s and 0.02 mrad of an independent truth."""
    assembly = configured("flight", {"filter": {"leave_one_out": False, "local_filters": False}})
    readings, truth = flight(1, 20 * 10**9, noise=0.0)
    heard = [reading for reading in readings if reading.sensor == "imu"]
    last = assembly.engine().process(records(assembly.layout, heard))["x"][-1]
    off = between(MODELS["enu"], last, np.append(truth.values[-1], np.zeros(3)))
    assert np.linalg.norm(off[:3]) < 1e-2
    assert np.linalg.norm(off[3:6]) < 1e-3
    assert np.linalg.norm(off[12:]) < 2e-5


def test_it_says_what_is_wrong_with_a_lever_a_mounting_or_a_model():
    def refusal(kind, process, **said):
        with pytest.raises(ConfigError) as told:
            SENSORS[kind].describe(process, **said)
        return str(told.value)

    body = MODELS["enu"]
    assert refusal("gnss_position", body, lever_m=[1.0]).startswith("lever_m: has 1 numbers, needs 3")
    assert refusal("wheel_velocity", body, axes=["x", "x"]).startswith("axes:")
    assert refusal("wheel_velocity", body, axes=["x"], scale=0.0).startswith("scale: is 0")
    assert refusal("attitude", body, angles=[]).startswith("angles:")
    assert refusal("attitude", body, angles=["yaw"], offset_rad=[0.0, 1.0]).startswith("offset_rad: has 2")
    assert refusal("magnetic_field", body, field=[0.0, 0.0, 0.0]).startswith("field: is zero")
    with pytest.raises(ConfigError, match="imu_mounting_rad: has 2 numbers"):
        strapdown.describe(frame="enu", imu_mounting_rad=[0.0, 1.0], **BODY)


@pytest.mark.parametrize("kind", sorted({kind for kind, _ in OBSERVED.values()}))
def test_without_an_attitude_it_names_the_model_that_has_one(kind):
    from fusiond.models.planar_constant_velocity import describe

    said = next(said for name, said in OBSERVED.values() if name == kind)
    with pytest.raises(ConfigError, match='choose the model "strapdown"'):
        SENSORS[kind].describe(describe(acceleration_noise_m_s2=1.0), **said)


def with_quaternion(w):
    """The flight's configuration, started at (w, 0, 0, 0)."""
    content = tomllib.loads((CONFIGS / "flight.toml").read_text(encoding="utf-8"))
    content["initial"].setdefault("state", {}).update(qw=w, qx=0.0, qy=0.0, qz=0.0)
    return Config.model_validate(content)


def test_an_initial_attitude_is_scaled_to_length_one():
    assembled = assemble(with_quaternion(2.0))
    names = [slot.name for slot in assembled.layout.states]
    assert assembled.design[0]["x0"][names.index("qw")] == 1.0


def test_an_initial_attitude_of_length_zero_is_refused():
    with pytest.raises(ConfigError, match="length zero"):
        assemble(with_quaternion(0.0))
