"""What drives the prediction: which interval a reading describes, discrete steps, and intervals cut in pieces."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from fusiond.assembly.assembly import assemble
from fusiond.config import parse
from fusiond.models.catalogue import PROCESSES
from fusiond.numerics.kernel import interpreted
from fusiond.types import Verdict
from tests.laws.engine_rig import MS, SECOND, one, reading, rig, tick

DT_NS = 100 * MS


def wall_robot(hold):
    """Seed 001: a position driven by its measured speed, dt = 0.1 s, range std 0.03, speed std 0.2."""
    text = f"""
    name = "wall"
    [model]
    kind = "driven_position"
    [initial]
    std = {{ position_m = 0.0 }}
    [sensor.speed]
    kind = "input"
    drives = ["velocity"]
    hold = "{hold}"
    noise_std = {{ velocity_m_s = 0.2 }}
    [sensor.range]
    kind = "direct"
    slots = ["position"]
    noise_std = {{ position_m = 0.03 }}
    """
    return assemble(parse(text, "wall"), Path()).engine()


def drive_to_the_wall(hold, seed):
    """The seed's 101 samples through the engine: estimates, readings z and u; u[i] is the speed over (i-1, i)."""
    rng = np.random.default_rng(seed)
    t = 0.1 * np.arange(101)
    x = 0.05 * t * np.cos(2.0 * t)
    u = np.concatenate([[0.0], np.diff(x) / 0.1]) + 0.2 * rng.standard_normal(101)
    z = x + 0.03 * rng.standard_normal(101)
    engine = wall_robot(hold)
    estimates = []
    for i in range(101):
        one(engine, "speed", SECOND + i * DT_NS, [u[i]])
        estimates.append(one(engine, "range", SECOND + i * DT_NS, [z[i]])["x"][0])
    return np.array(estimates), z, u, engine


@pytest.mark.parametrize(("hold", "lag"), [("previous", 0), ("next", 1)])
def test_a_speed_describes_the_interval_that_its_hold_says(hold, lag):
    """Seed 001 as a scalar filter: `previous` predicts with u(i), `next` with u(i-1), the seed's off-by-one."""
    estimates, z, u, engine = drive_to_the_wall(hold, 3)
    x, P = 0.0, 0.0
    for i in range(101):
        if i > 0:
            x, P = x + 0.1 * u[i - lag], P + 4e-4
        K = P / (P + 9e-4)
        x, P = x + K * (z[i] - x), (1.0 - K) * P
        assert estimates[i] == pytest.approx(x, abs=1e-12)
    assert engine.covariance()[0, 0] == pytest.approx(4.3246e-4, rel=1e-4)
    assert pytest.approx(0.48051, rel=1e-4) == K


def test_an_input_holds_until_the_next_one():
    """`next`: position follows u = 2 from its stamp on, u = 0 before; ticks show it, the variance of u included."""
    engine = wall_robot("next")
    one(engine, "range", SECOND, [0.0])
    one(engine, "speed", SECOND + DT_NS, [2.0])
    for k, expected in ((1, 0.0), (2, 0.2), (6, 1.0)):
        told = engine.process(tick(engine.layout, SECOND + k * DT_NS))[0]
        assert told["x"][0] == pytest.approx(expected, abs=1e-12)
        assert told["std"][0] == pytest.approx(0.2 * 0.1 * (k - 1), abs=1e-12)


def test_inputs_are_used_but_leave_no_innovation():
    engine = wall_robot("previous")
    report = one(engine, "speed", SECOND, [1.0])
    assert report["verdict"] == Verdict.USED
    assert report["dof"] == 0
    assert report["nis"] == 0.0
    assert report["R_used"][0] == pytest.approx(0.04)


DISCRETE = {"A": [[1.0, 0.1], [0.0, 1.0]], "B": [[0.0], [0.1]], "Q": [[0.0, 0.0], [0.0, 0.01]], "step_s": 0.1}


def steps_after(engine, dt_ns):
    """How many steps of the discrete model are taken for a reading dt_ns after the first."""
    engine.reset()
    one(engine, "c", SECOND, [0.0])
    report = one(engine, "c", SECOND + dt_ns, [0.0])
    return (int(report["state_t_ns"]) - SECOND) / (100 * MS)


def test_a_discrete_model_goes_to_the_nearest_step():
    """Half a step is rounded up, a nanosecond less down; the state's time says what was done."""
    engine = rig(model=DISCRETE)
    half_ns = 50 * MS
    cases = {0: 0, half_ns - 1: 0, half_ns: 1, 3 * half_ns - 1: 1, 3 * half_ns: 2, 20 * half_ns + 7: 10}
    assert {dt_ns: steps_after(engine, dt_ns) for dt_ns in cases} == cases


def test_rounding_to_steps_never_drifts():
    """Readings every 99.7 ms for 100 s: a thousand stamps, 997 steps."""
    engine = rig(model=DISCRETE)
    for k in range(1001):
        report = one(engine, "c", SECOND + k * 99_700_000, [0.0])
        assert abs(int(report["state_t_ns"]) - int(report["t_ns"])) <= 50 * MS
    assert (int(report["state_t_ns"]) - SECOND) == 997 * 100 * MS


def test_a_discrete_model_is_stepped_as_written():
    """x(k+1) = A x(k) + B u(k) and P = A P A' + G Q G' + B var B', three steps at once."""
    engine = rig(model=DISCRETE)
    one(engine, "drive", SECOND, [2.0])
    x, P = engine.track[0]["x"][0].copy(), engine.covariance()
    A, B = np.array(DISCRETE["A"]), np.array(DISCRETE["B"])
    for _ in range(3):
        x, P = A @ x + 2.0 * B[:, 0], A @ P @ A.T + np.array(DISCRETE["Q"]) + 0.25**2 * B @ B.T
    told = engine.process(tick(engine.layout, SECOND + 300 * MS))[0]
    assert told["x"] == pytest.approx(x, abs=1e-12)
    assert told["std"] == pytest.approx(np.sqrt(np.diag(P)), rel=1e-9)


ROBOT = """
name = "robot"
[model]
kind = "planar_robot"
acceleration_noise_m_s2_sqrt_hz = 0.5
yaw_acceleration_noise_rad_s2_sqrt_hz = 0.3
max_step_s = {max_step_s}
[initial]
state = {{ yaw_rad = 3.1, speed_m_s = 2.0, yaw_rate_rad_s = 0.4 }}
std = {{ x_m = 0.1, y_m = 0.1, yaw_rad = 0.1, speed_m_s = 0.1, yaw_rate_rad_s = 0.1, gyro_bias_rad_s = 0.01 }}
[sensor.beacon]
kind = "beacon_range"
beacons = [[1.0, 10.0, 0.0], [2.0, 0.0, 10.0], [3.0, -10.0, -3.0]]
noise_std = {{ range_m = 0.2 }}
[sensor.compass]
kind = "heading"
noise_std = {{ yaw_rad = 0.05 }}
[sensor.gyro]
kind = "yaw_rate"
noise_std = {{ yaw_rate_rad_s = 0.02 }}
"""


def robot(max_step_s=0.1):
    return assemble(parse(ROBOT.format(max_step_s=max_step_s), "robot"), Path()).engine()


def predicted(x, P, engine, intervals_s):
    """The robot's model over these intervals, interpreted and dense."""
    model, p = PROCESSES["planar_robot"], engine._design[0]["p"]
    for dt_s in intervals_s:
        x_next, F, G, q = np.zeros(6), np.zeros((6, 6)), np.zeros((6, 3)), np.zeros(3)
        interpreted(model.transition)(x, np.zeros(1), dt_s, p, x_next, F, np.zeros((6, 1)))
        interpreted(model.noise)(x, dt_s, p, G, q)
        x, P = x_next, F @ P @ F.T + (G * q) @ G.T
    return x, P


@pytest.mark.parametrize(
    ("max_step_s", "intervals_s"),
    [(0.1, [0.1] * 10), (0.3, [0.25] * 4), (2.0, [1.0]), (1.0, [1.0]), (0.999, [0.5] * 2)],
)
def test_a_long_interval_is_cut_into_equal_pieces_no_longer_than_allowed(max_step_s, intervals_s):
    engine = robot(max_step_s)
    one(engine, "compass", SECOND, [3.1])
    x, P = predicted(engine.track[0]["x"][0], engine.covariance(), engine, intervals_s)
    told = engine.process(tick(engine.layout, 2 * SECOND))[0]
    assert told["state_t_ns"] == 2 * SECOND
    assert told["x"] == pytest.approx(x, abs=1e-12)
    assert told["std"] == pytest.approx(np.sqrt(np.diag(P)), rel=1e-9)


def test_pieces_end_on_the_arc():
    """Constant speed and yaw rate: after a second in ten pieces the robot is on its circle, across the half turn."""
    engine = robot()
    told = one(engine, "compass", SECOND, [3.1])
    x, y, yaw, speed, rate = told["x"][:5]
    end = engine.process(tick(engine.layout, 2 * SECOND))[0]
    radius = speed / rate
    assert end["x"][0] == pytest.approx(x + radius * (math.sin(yaw + rate) - math.sin(yaw)), abs=2e-3)
    assert end["x"][1] == pytest.approx(y + radius * (math.cos(yaw) - math.cos(yaw + rate)), abs=2e-3)
    assert -math.pi <= end["x"][2] < math.pi
    assert end["x"][2] == pytest.approx(yaw + rate - 2.0 * math.pi, abs=1e-9)


def test_a_heading_is_compared_on_the_circle():
    """A reading of -3.1 beside an estimate of 3.1 is 0.083 rad off, not -6.2; the estimate moves by its share."""
    engine = robot()
    first = one(engine, "compass", SECOND, [3.1])
    report = one(engine, "compass", SECOND, [-3.1])
    share = first["std"][2] ** 2 / (first["std"][2] ** 2 + 0.05**2)
    assert report["nu"][0] == pytest.approx(2.0 * math.pi - 6.2, abs=1e-12)
    assert report["x"][2] == pytest.approx(3.1 + share * (2.0 * math.pi - 6.2), abs=1e-12)


def test_an_estimate_stays_on_the_circle_when_it_is_moved_across():
    engine = robot()
    one(engine, "compass", SECOND, [3.13])
    for k in range(20):
        report = one(engine, "compass", SECOND + MS, [-3.05 + 0.001 * k])
    assert report["x"][2] == pytest.approx(-3.05, abs=0.03)


@pytest.mark.parametrize(
    ("number", "verdict"), [(2.0, Verdict.USED), (4.0, Verdict.UNKNOWN_INDEX), (1.5, Verdict.UNKNOWN_INDEX)]
)
def test_a_range_to_a_beacon_nobody_configured_is_refused(number, verdict):
    engine = robot()
    one(engine, "compass", SECOND, [3.1])
    before = engine.track.tobytes()
    report = one(engine, "beacon", SECOND + MS, [10.0, number])
    assert report["verdict"] == verdict
    assert (engine.track.tobytes() == before) == (verdict != Verdict.USED)
    assert report["dof"] == (1 if verdict == Verdict.USED else 0)


def test_an_extended_filter_ends_in_the_same_bits_whatever_the_order():
    engine = robot()
    rng = np.random.default_rng(4)
    records = []
    for k in range(60):
        name, z = [("beacon", [9.0 + rng.normal(), 1.0 + k % 3]), ("compass", [3.1]), ("gyro", [0.4])][k % 3]
        records.append(reading(engine.layout, name, SECOND + (k // 2) * 15 * MS, z))
    records = np.concatenate(records)
    engine.process(records)
    state = engine.state_sha256()
    engine.reset()
    engine.process(records[rng.permutation(60)])
    assert engine.state_sha256() == state
