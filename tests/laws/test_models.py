"""Every process and sensor model: Jacobians against differences, noises against exact integrals."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusiond.config import parameters, read
from fusiond.errors import ConfigError
from fusiond.models.catalogue import PROCESSES, SENSORS
from fusiond.numerics.discretise import van_loan
from fusiond.numerics.kernel import interpreted

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
NONLINEAR = {
    "driven_robot": "plaza2_scale",
    "ground_vehicle": "ground_vehicle",
    "planar_body": "jackal",
    "planar_robot": "planar",
    "single_track": "single_track",
}
"""Every model with a transition, and the configuration that has parameters for it."""
SEEDS = st.integers(0, 10**9)
ROBOT = PROCESSES["planar_robot"].describe(
    acceleration_noise_m_s2_sqrt_hz=0.5,
    yaw_acceleration_noise_rad_s2_sqrt_hz=0.3,
    gyro_bias_noise_rad_s_sqrt_s=0.01,
)
POINT = PROCESSES["planar_constant_velocity"].describe(acceleration_noise_m_s2=0.7)
VEHICLE = PROCESSES["ground_vehicle"].describe(
    **parameters(read(CONFIGS / "ground_vehicle.toml").model, "model")
)
MASS = PROCESSES["driven_point_mass"].describe()
MOWER = PROCESSES["driven_robot"].describe(constants=["clock", "range_scale"])
SPACE = PROCESSES["linear"].describe(
    states=["x", "y", "z", "range_scale"],
    A=np.zeros((4, 4)).tolist(),
    G=np.eye(4).tolist(),
    Q=np.eye(4).tolist(),
)
OBSERVED = {
    "beacon_range": (ROBOT, {"beacons": [[3.0, 1.0, 2.0], [7.0, -4.0, 9.0]], "height_m": 1.5}, [0.0, 7.0]),
    "beacon_range.scaled": (
        MOWER,
        {"beacons": [[3.0, 1.0, 2.0], [7.0, -4.0, 9.0]], "scale_state": "range_scale", "scale": 1.1},
        [0.0, 3.0],
    ),
    "beacon_range.space": (SPACE, {"beacons": [[3.0, 1.0, 2.0, -8.0], [7.0, -4.0, 9.0, 6.0]]}, [0.0, 7.0]),
    "beacon_range.all": (
        SPACE,
        {"beacons": [[3.0, 1.0, 2.0, 9.0]], "scale_state": "range_scale"},
        [0.0, 3.0],
    ),
    "direct": (ROBOT, {"slots": ["yaw", "speed"]}, [0.0, 0.0]),
    "gps_course": (VEHICLE, {}, [0.0] * 4),
    "gps_position": (ROBOT, {"lever_forward_m": 0.8, "lever_left_m": -0.3}, [0.0, 0.0]),
    "gps_position.bare": (POINT, {}, [0.0, 0.0]),
    "heading": (ROBOT, {"offset_rad": 3.0}, [0.0]),
    "linear": (MASS, {"H": [[1.0, 2.0, 3.0], [0.0, -1.0, 0.5]]}, [0.0, 0.0]),
    "radar": (POINT, {"x_m": 0.4, "y_m": -2.0}, [0.0, 0.0, 0.0]),
    "radar.polar": (ROBOT, {}, [0.0, 0.0, 0.0]),
    "tracklet": (
        ROBOT,
        {"channels": ["z"], "reads": ["yaw", "speed"], "H": [[0.5, 3.0]]},
        [0.2, 0.3, 2.0, -1.0, 2.5, 1.0],
    ),
    "tracklet.typical": (
        ROBOT,
        {"channels": ["z"], "reads": ["yaw", "speed"], "H": [[0.5, 3.0]]},
        [0.2, *[math.nan] * 5],
    ),
    "wheel_speed": (ROBOT, {"scale": 1.07}, [0.0]),
    "yaw_rate": (ROBOT, {}, [0.0]),
    "yaw_rate.unbiased": (
        PROCESSES["linear"].describe(states=["yaw_rate"], A=[[0.0]], G=[[1.0]], Q=[[1.0]]),
        {},
        [0.0],
    ),
}
"""What every kind of sensor is tried with: a process model, its parameters, and a reading that carries its index."""
ON_A_MANIFOLD = {
    "attitude", "barometer", "body_gyro", "gnss_position", "gnss_velocity", "magnetic_field", "vehicle_course",
    "wheel_pair", "wheel_velocity", "zero_velocity",
}  # fmt: skip
"""Sensors of a state that is no vector: tests/laws/test_strapdown.py and test_slipping_robot.py."""


def on_circle(difference):
    """A difference of angles, in [-pi, pi)."""
    return (difference + math.pi) % (2.0 * math.pi) - math.pi


def differences(function, at, wraps=()):
    """Jacobian by central differences; rows in `wraps` are differences on the circle."""
    columns = []
    for j in range(len(at)):
        step = np.zeros(len(at))
        step[j] = 1e-6 * max(1.0, abs(at[j]))
        column = function(at + step) - function(at - step)
        for i in wraps:
            column[i] = on_circle(column[i])
        columns.append(column / (2.0 * step[j]))
    return np.array(columns).T


def transition_of(process, module, x, u, dt_s):
    n, m = len(process.states), len(process.inputs)
    x_next, F, B = np.zeros(n), np.zeros((n, n)), np.zeros((n, max(1, m)))
    interpreted(module.transition)(x, u, dt_s, np.array(process.parameters), x_next, F, B)
    return x_next, F, B


def interval_of(kind, process, dt_s):
    """F, B, c and the covariance G diag(q) G' that `discretise` writes."""
    n, m, k = len(process.states), max(1, len(process.inputs)), process.noises
    F, B, c, G, q = np.zeros((n, n)), np.zeros((n, m)), np.zeros(n), np.zeros((n, k)), np.zeros(k)
    interpreted(PROCESSES[kind].discretise)(dt_s, np.array(process.parameters), F, B, c, G, q)
    assert (q >= 0.0).all()
    return F, B, c, (G * q) @ G.T


def observed(case, x):
    process, said, z = OBSERVED[case]
    module = SENSORS[case.split(".")[0]]
    sensor = module.describe(process, **said)
    names = [slot.name for slot in process.states]
    at = np.array([names.index(name) for name in sensor.reads])
    h, H = np.zeros(len(sensor.channels)), np.zeros((len(sensor.channels), len(x)))
    known = interpreted(module.observe)(x, np.array(z), at, np.array(sensor.parameters or (0.0,)), h, H)
    return known, h[: sensor.dof], H[: sensor.dof], sensor


def test_every_built_in_sensor_is_tried():
    assert {case.split(".")[0] for case in OBSERVED} | ON_A_MANIFOLD == set(SENSORS)


@pytest.mark.parametrize("case", OBSERVED)
@given(seed=SEEDS)
@settings(max_examples=15)
def test_a_sensors_jacobian_is_the_derivative_of_its_reading(case, seed):
    x = np.random.default_rng(seed).uniform(-5.0, 5.0, len(OBSERVED[case][0].states))
    known, _, H, sensor = observed(case, x)
    names = [slot.name for slot in sensor.channels]
    numerical = differences(lambda at: observed(case, at)[1], x, [names.index(name) for name in sensor.wraps])
    assert known
    assert pytest.approx(numerical, rel=1e-6, abs=1e-6) == H


def test_every_built_in_process_is_tried():
    discretised = {"driven_point_mass", "driven_position", "linear", "planar_constant_velocity"}
    assert discretised | set(NONLINEAR) | {"slipping_robot", "strapdown"} == set(PROCESSES)


@pytest.mark.parametrize("kind", NONLINEAR)
@given(seed=SEEDS, dt_s=st.sampled_from([1e-3, 0.02, 0.1]))
@settings(max_examples=15)
def test_a_transitions_jacobians_are_its_derivatives(kind, seed, dt_s):
    """By state and by input, at any heading, also across the half turn."""
    module = PROCESSES[kind]
    process = module.describe(**parameters(read(CONFIGS / f"{NONLINEAR[kind]}.toml").model, "model"))
    names = [slot.name for slot in process.states]
    rng = np.random.default_rng(seed)
    x, u = rng.uniform(-4.0, 4.0, len(names)), rng.uniform(0.1, 3.0, max(1, len(process.inputs)))
    angles = [names.index(name) for name in process.angles]
    for angle in angles:
        x[angle] = rng.choice([math.pi - 1e-7, -math.pi, rng.uniform(-math.pi, math.pi)])
    _, F, B = transition_of(process, module, x, u, dt_s)
    by_state = differences(lambda at: transition_of(process, module, at, u, dt_s)[0], x, angles)
    by_input = differences(lambda at: transition_of(process, module, x, at, dt_s)[0], u, angles)
    scale = 1.0 + np.abs(by_state).max()
    assert np.abs(F - by_state).max() <= 1e-7 * scale
    if process.inputs:
        assert np.abs(B - by_input).max() <= 1e-7 * (1.0 + np.abs(by_input).max())


@pytest.mark.parametrize("way", [(1.0, 0.0), (0.0, 1.0), (-3.0, 4.0)])
def test_the_robot_drives_a_circle(way):
    """Ten thousand small steps end on the arc of radius speed / yaw rate, turned by yaw rate times time."""
    yaw = math.atan2(way[1], way[0])
    x = np.array([0.0, 0.0, yaw, 2.0, 0.5, 0.1])
    for _ in range(10_000):
        x = transition_of(ROBOT, PROCESSES["planar_robot"], x, np.zeros(1), 1e-3)[0]
    radius, turned = 4.0, 5.0
    end = radius * np.array([math.sin(yaw + turned) - math.sin(yaw), math.cos(yaw) - math.cos(yaw + turned)])
    assert x[:2] == pytest.approx(end, abs=1e-6)
    assert on_circle(x[2] - yaw - turned) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("dt_s", [1e-3, 0.1])
def test_the_robots_noise_is_the_exact_integral_to_first_order(dt_s):
    """G diag(q) G' against Van Loan's integral of the motion linearised at the same state, in leading order."""
    x, p = np.array([0.0, 0.0, 0.6, 0.0, 0.0, 0.0]), np.array(ROBOT.parameters)
    G, q = np.zeros((6, 3)), np.zeros(3)
    interpreted(PROCESSES["planar_robot"].noise)(x, dt_s, p, G, q)
    A = np.zeros((6, 6))
    A[0, 3], A[1, 3], A[2, 4] = math.cos(0.6), math.sin(0.6), 1.0
    exact = van_loan(A, np.zeros((6, 1)), np.diag([0.0, 0.0, 0.0, *p]), dt_s)[2]
    held = (G * q) @ G.T
    speeds = [3, 4, 5]
    assert held[speeds] == pytest.approx(exact[speeds], rel=1e-12, abs=1e-18)
    assert np.diag(held)[:3] == pytest.approx(0.75 * np.diag(exact)[:3], rel=1e-12)


@pytest.mark.parametrize("dt_s", [0.0, 1e-6, 1e-3, 0.1, 2.5])
@pytest.mark.parametrize("bias", [True, False])
def test_the_point_mass_is_discretised_exactly(bias, dt_s):
    process = PROCESSES["driven_point_mass"].describe(
        bias=bias, gravity_m_s2=9.81, velocity_noise_m_s_sqrt_s=0.3, bias_noise_m_s2_sqrt_s=0.02
    )
    n = 3 if bias else 2
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0]])[:n, :n]
    B = np.array([[0.0], [1.0], [0.0]])[:n]
    F_d, B_d, Q = van_loan(A, B, np.diag([0.0, 0.3**2, 0.02**2])[:n, :n], dt_s)
    F, B_written, c, noise = interval_of("driven_point_mass", process, dt_s)
    assert pytest.approx(F_d, rel=1e-13, abs=1e-15) == F
    assert pytest.approx(B_d, rel=1e-13, abs=1e-15) == B_written
    assert c == pytest.approx(-9.81 * B_d[:, 0], rel=1e-13, abs=1e-15)
    assert noise == pytest.approx(Q, rel=1e-9, abs=1e-20)


@pytest.mark.parametrize("dt_s", [0.0, 1e-3, 0.1, 2.5])
def test_white_acceleration_is_integrated_exactly(dt_s):
    A = np.zeros((4, 4))
    A[0, 2] = A[1, 3] = 1.0
    F_d, _, Q = van_loan(A, np.zeros((4, 1)), np.diag([0.0, 0.0, 0.49, 0.49]), dt_s)
    F, _, _, noise = interval_of("planar_constant_velocity", POINT, dt_s)
    assert pytest.approx(F_d, abs=1e-15) == F
    assert noise == pytest.approx(Q, rel=1e-9, abs=1e-20)


@pytest.mark.parametrize("dt_s", [0.1, 0.05])
def test_an_acceleration_in_steps_has_the_course_books_covariance(dt_s):
    """Q = sigma^2 [[dt^4/4, dt^3/2], [dt^3/2, dt^2]] on each axis."""
    process = PROCESSES["planar_constant_velocity"].describe(acceleration_noise_m_s2=3.0, noise="steps")
    noise = interval_of("planar_constant_velocity", process, dt_s)[3]
    axis = 9.0 * np.array([[dt_s**4 / 4.0, dt_s**3 / 2.0], [dt_s**3 / 2.0, dt_s**2]])
    assert noise[np.ix_([0, 2], [0, 2])] == pytest.approx(axis, rel=1e-12)
    assert noise[np.ix_([1, 3], [1, 3])] == pytest.approx(axis, rel=1e-12)
    assert not noise[np.ix_([0, 2], [1, 3])].any()


def test_a_driven_position_walks_and_moves():
    process = PROCESSES["driven_position"].describe(position_noise_m_sqrt_s=0.3)
    F, B, c, noise = interval_of("driven_position", process, 0.1)
    assert (F[0, 0], B[0, 0], c[0]) == (1.0, 0.1, 0.0)
    assert noise[0, 0] == pytest.approx(0.009)


MATRICES = {
    "states": ["a", "b"],
    "A": [[-0.5, 1.0], [0.0, -2.0]],
    "G": [[1.0, 0.5], [0.0, 2.0]],
    "Q": [[2.0, 0.6], [0.6, 0.5]],
    "B": [[0.0], [3.0]],
    "inputs": ["u"],
}


@pytest.mark.parametrize("dt_s", [1e-3, 0.1, 5.0])
def test_a_continuous_linear_model_is_discretised_exactly(dt_s):
    A, B, G, Q = (np.array(MATRICES[name]) for name in "ABGQ")
    F_d, B_d, Q_d = van_loan(A, B, G @ Q @ G.T, dt_s)
    F, B_written, c, noise = interval_of("linear", PROCESSES["linear"].describe(**MATRICES), dt_s)
    assert np.array_equal(F, F_d)
    assert np.array_equal(B_written, B_d)
    assert not c.any()
    assert noise == pytest.approx(Q_d, rel=1e-12, abs=1e-18)


def test_a_discrete_linear_model_is_taken_as_written():
    """Also with a correlated Q."""
    process = PROCESSES["linear"].describe(**MATRICES, step_s=0.1)
    F, B, _, noise = interval_of("linear", process, 0.1)
    G, Q = np.array(MATRICES["G"]), np.array(MATRICES["Q"])
    assert np.array_equal(F, MATRICES["A"])
    assert np.array_equal(B, MATRICES["B"])
    assert noise == pytest.approx(G @ Q @ G.T, rel=1e-12)


def test_a_noise_that_enters_through_the_input_matrix_has_its_rank():
    """Seed 004, equation 2-10: x+ = A x + B (u + w), so the noise has rank one."""
    process = PROCESSES["linear"].describe(
        states=["a", "b", "c"], A=np.eye(3).tolist(), G=[[-0.3832], [0.5919], [0.5191]], Q=[[2.3]], step_s=1.0
    )
    noise = interval_of("linear", process, 1.0)[3]
    column = np.array([-0.3832, 0.5919, 0.5191])
    assert noise == pytest.approx(2.3 * np.outer(column, column))


def test_a_beacon_nobody_configured_is_told():
    process, said, _ = OBSERVED["beacon_range"]
    sensor = SENSORS["beacon_range"].describe(process, **said)
    observe, p = interpreted(SENSORS["beacon_range"].observe), np.array(sensor.parameters)
    h, H = np.zeros(2), np.zeros((2, 6))
    assert not observe(np.zeros(6), np.array([1.0, 4.0]), np.array([0, 1]), p, h, H)
    assert observe(np.zeros(6), np.array([1.0, 3.0]), np.array([0, 1]), p, h, H)
    assert h[0] == pytest.approx(math.sqrt(1.0 + 4.0 + 1.5**2))


@pytest.mark.parametrize("case", ["radar", "beacon_range"])
def test_on_top_of_a_sensor_nothing_is_divided_by_zero(case):
    """The direction is unknown there: the rows of H are finite."""
    x = np.zeros(len(OBSERVED[case][0].states))
    x[:2] = (0.4, -2.0) if case == "radar" else (-4.0, 9.0)
    _, h, H, _ = observed(case, x)
    assert np.isfinite(h).all()
    assert np.isfinite(H).all()


def test_a_driven_robot_drives_a_circle():
    """A metre a second and half a radian a second, 1 ms at a time: a quarter turn on a radius of 2 m."""
    x, process = np.array([0.0, 0.0, 0.0, 7.0, 1.07]), MOWER
    for _ in range(1000):
        x = transition_of(process, PROCESSES["driven_robot"], x, np.array([1.0, 0.5]), math.pi * 1e-3)[0]
    assert x == pytest.approx([2.0, 2.0, 0.5 * math.pi, 7.0, 1.07], abs=1e-6)


@pytest.mark.parametrize("name", ["yaw", "range_scale"])
def test_a_constant_has_a_name_of_its_own(name):
    with pytest.raises(ConfigError, match=f"`{name}` is a state already"):
        PROCESSES["driven_robot"].describe(constants=[name, "range_scale", name])


def test_the_derived_outputs_are_those_of_the_plane():
    y = np.zeros(2)
    interpreted(PROCESSES["planar_constant_velocity"].derive)(np.array([0.0, 0.0, -3.0, 4.0]), np.zeros(1), y)
    assert y == pytest.approx([5.0, math.atan2(4.0, -3.0)])
    interpreted(PROCESSES["planar_robot"].derive)(
        np.array([0.0, 0.0, math.pi / 6.0, 2.0, 0.0, 0.0]), np.zeros(1), y
    )
    assert y == pytest.approx([math.sqrt(3.0), 1.0])


def refusal(kind, process, **said):
    with pytest.raises(ConfigError) as told:
        SENSORS[kind].describe(process, **said)
    return str(told.value)


def test_a_sensor_says_which_state_it_misses():
    assert refusal("heading", POINT) == "no state `yaw`; the process model has x, y, vx, vy"
    assert "vx, vy or yaw, speed" in refusal("radar", MASS)
    assert refusal("gps_position", POINT, lever_forward_m=0.5).endswith("set the lever to 0")
    assert "[number, x_m, y_m]" in refusal("beacon_range", POINT, beacons=[[1.0, 2.0]])
    both = [[1.0, 2.0, 3.0], [1.0, 5.0, 6.0]]
    assert "twice" in refusal("beacon_range", POINT, beacons=both)
    assert "no state `z`" in refusal("beacon_range", POINT, beacons=[[1.0, 2.0, 3.0, 4.0]])
    assert "no state `range_scale`" in refusal(
        "beacon_range", POINT, beacons=both[:1], scale_state="range_scale"
    )
    assert "scale: is 0" in refusal("beacon_range", POINT, beacons=both[:1], scale=0.0)
    assert "strapdown" in refusal("vehicle_course", POINT)
    assert refusal("linear", MASS, H=[[1.0, 2.0]]).startswith("H: has 1 rows of [2] numbers, needs 1 x 3")


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"A": [[1.0]]}, "A: has"),
        ({"A": [[1.0, 2.0], [3.0]]}, "A: has"),
        ({"G": [[1.0, 0.0]]}, "G: has"),
        ({"Q": [[1.0]]}, "Q: has"),
        ({"B": None}, "B: has"),
        ({"Q": [[1.0, 2.0], [2.0, 1.0]]}, "not positive semi-definite"),
    ],
)
def test_a_linear_model_says_which_matrix_is_wrong(change, told):
    with pytest.raises(ConfigError, match=told.replace("[", r"\[")):
        PROCESSES["linear"].describe(**{**MATRICES, **change})
