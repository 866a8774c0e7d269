"""The strapdown filter in motion: a mounting, a wrong start, standing still, and wheels where there is no sky."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson
from scipy.spatial.transform import Rotation

from fusiond.assembly.assembly import assemble
from fusiond.config import parse
from fusiond.models import strapdown
from fusiond.numerics.kernel import interpreted
from fusiond.simulation.flight import flight, nominal_start
from fusiond.simulation.tables import Reading
from tools.pages.trials import configured, records

SECOND = 10**9
ONE_FILTER = {"leave_one_out": False, "local_filters": False}


def off(assembly, x, truth):
    """(15,) from the estimate to the truth's last row."""
    process, dx = assembly.resolved.process, np.zeros(15)
    y = np.append(truth.values[-1], np.zeros(3))
    interpreted(strapdown.error_between)(x, y, np.array(process.parameters), dx)
    return dx


def final(assembly, readings):
    """State and covariance after all readings, in order of time."""
    engine = assembly.engine()
    in_time = sorted(readings, key=lambda reading: reading.t_ns)
    x = engine.process(records(assembly.layout, in_time))["x"][-1].copy()
    return x, engine.covariance()


def test_an_imu_may_be_mounted_any_way():
    """Its readings in turned axes, with the turn configured, end in the same state and covariance."""
    readings, _ = flight(5, 10 * SECOND)
    angles = [2.0, -0.7, 1.3]
    back = Rotation.from_euler("ZYX", angles[::-1]).inv()
    mounted = [
        Reading(r.t_ns, r.sensor, (*back.apply(r.z[:3]), *back.apply(r.z[3:]))) if r.sensor == "imu" else r
        for r in readings
    ]
    straight, P = final(configured("flight", {"filter": ONE_FILTER}), readings)
    turned, P_turned = final(
        configured("flight", {"filter": ONE_FILTER, "model": {"imu_mounting_rad": angles}}), mounted
    )
    assert turned[:16] == pytest.approx(straight[:16], abs=1e-9)
    assert P_turned == pytest.approx(P, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("wrong_rad", [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.5, 0.5, 0.5], [1.0, 0.0, 0.0]])
def test_a_start_a_radian_wrong_is_found(wrong_rad):
    """GIVEN a deviation that says so, THEN 40 s later the attitude is within 10 mrad and the position within 1 m."""
    start = nominal_start()
    true = Rotation.from_quat([start[key] for key in ("qx", "qy", "qz", "qw")])
    x, y, z, w = (Rotation.from_rotvec(wrong_rad) * true).as_quat()
    std = {f"attitude_{axis}_rad": max(0.1, abs(angle)) for axis, angle in zip("xyz", wrong_rad, strict=True)}
    initial = {"state": {"qw": w, "qx": x, "qy": y, "qz": z}, "std": std}
    assembly = configured("flight", {"filter": ONE_FILTER, "initial": initial})
    readings, truth = flight(7, 40 * SECOND)
    error = off(assembly, final(assembly, readings)[0], truth)
    assert np.linalg.norm(error[12:]) < 0.01
    assert np.linalg.norm(error[:3]) < 1.0


CAR = """
name = "car"
[model]
kind = "strapdown"
frame = "enu"
gyro_bias_noise_rad_s_sqrt_s = 1e-5
accel_bias_noise_m_s2_sqrt_s = 1e-4
[initial]
state = { qw = 1.0 }
[initial.std]
x_m = 0.0
y_m = 0.0
z_m = 0.0
vx_m_s = 0.1
vy_m_s = 0.1
vz_m_s = 0.1
gyro_bias_x_rad_s = 0.02
gyro_bias_y_rad_s = 0.02
gyro_bias_z_rad_s = 0.02
accel_bias_x_m_s2 = 0.1
accel_bias_y_m_s2 = 0.1
accel_bias_z_m_s2 = 0.1
attitude_x_rad = 0.02
attitude_y_rad = 0.02
attitude_z_rad = 0.0
[filter]
leave_one_out = false
local_filters = false
accept_unobservable = ["x", "y", "z", "attitude_z"]
[sensor.imu]
kind = "input"
hold = "previous"
drives = [
    "angular_rate_x", "angular_rate_y", "angular_rate_z",
    "specific_force_x", "specific_force_y", "specific_force_z",
]
[sensor.imu.noise_std]
angular_rate_x_rad_s = 0.01
angular_rate_y_rad_s = 0.01
angular_rate_z_rad_s = 0.01
specific_force_x_m_s2 = 0.1
specific_force_y_m_s2 = 0.1
specific_force_z_m_s2 = 0.1
[sensor.wheels]
kind = "wheel_velocity"
axes = ["x", "y", "z"]
lever_m = [-1.0, 0.0, -0.5]
noise_std = { body_vx_m_s = 0.05, body_vy_m_s = 0.05, body_vz_m_s = 0.05 }
[sensor.standstill]
kind = "zero_velocity"
[sensor.standstill.noise_std]
vx_m_s = 0.02
vy_m_s = 0.02
vz_m_s = 0.02
rate_x_rad_s = 0.01
rate_y_rad_s = 0.01
rate_z_rad_s = 0.01
"""
PARKED_S, END_S = 20.0, 80.0
GYRO_BIAS = np.array([0.015, -0.01, 0.02])
FORCE_BIAS = np.array([0.0, 0.0, 0.08])
"""Level and parked, the biases of the horizontal accelerometers are not told from a tilt: left at zero."""


@cache
def car():
    return assemble(parse(CAR, "car"))


@cache
def drive():
    """Parked for 20 s, then up to 12 m/s in gentle bends; IMU and wheels 100 Hz and 20 Hz, seeded, and the path.

    Level ground: yaw by integration of its rate, position of velocity, on a grid of 1 ms (Simpson).
    """
    t_s = np.arange(0, int(END_S * 1000) + 1) * 1e-3
    since = np.clip(t_s - PARKED_S, 0.0, None)
    speed = 12.0 * (1.0 - np.exp(-((since / 8.0) ** 3)))
    gain = np.gradient(speed, t_s)
    rate = 0.2 * np.sin(0.3 * since) * (1.0 - np.exp(-((since / 8.0) ** 3)))
    yaw = cumulative_simpson(rate, x=t_s, initial=0.0)
    path = [cumulative_simpson(speed * part, x=t_s, initial=0.0) for part in (np.cos(yaw), np.sin(yaw))]
    level, rng = np.zeros_like(t_s), np.random.default_rng(8)
    exact = np.column_stack((level, level, rate, gain, rate * speed, level + 9.80665))
    means = np.vstack((exact[:1], exact[1:].reshape(-1, 10, 6).mean(axis=1)))
    z = (
        means
        + np.append(GYRO_BIAS, FORCE_BIAS)
        + rng.standard_normal(means.shape) * np.repeat([0.01, 0.1], 3)
    )
    readings = [Reading(k * 10_000_000, "imu", tuple(row)) for k, row in enumerate(z.tolist())]
    for k in range(0, t_s.size, 50):
        wheels = [speed[k], -rate[k], 0.0] + 0.05 * rng.standard_normal(3)
        readings.append(Reading(k * 1_000_000, "wheels", tuple(wheels.tolist())))
    parked = range(0, int(PARKED_S * SECOND), 10_000_000)
    readings += [Reading(t_ns, "standstill", (0.0,) * 6) for t_ns in parked]
    return readings, np.column_stack((*path, yaw))


def driven(*sensors):
    """State and covariance at the end, of these sensors alone, and how far the position is off, m."""
    readings, path = drive()
    x, P = final(car(), [reading for reading in readings if reading.sensor in sensors])
    return x, P, float(np.hypot(*(x[:2] - path[-1, :2]))), path


def test_standing_still_teaches_the_gyro_s_bias():
    """20 s of zeros: each axis to 1 mrad/s, and no nearer than the deviation says (four of them)."""
    readings, _ = drive()
    x, P = final(
        car(), [r for r in readings if r.t_ns < PARKED_S * SECOND and r.sensor in ("imu", "standstill")]
    )
    error, std = x[6:9] - GYRO_BIAS, np.sqrt(np.diag(P)[6:9])
    assert np.abs(error).max() < 1e-3
    assert np.all(std < 1e-3)
    assert np.all(np.abs(error) < 4.0 * std)
    assert x[:3] == pytest.approx(np.zeros(3), abs=0.05)


def test_wheels_that_cannot_slip_carry_the_position_through_a_tunnel():
    """634 m without any position: the IMU alone is kilometres off, with the wheels 1.1 % of the way, and says so.

    The zeros of the parked 20 s before teach the gyro's bias; without them the heading is lost, and the end with it.
    """
    alone_m = driven("imu")[2]
    unparked_m = driven("imu", "wheels")[2]
    x, P, both_m, path = driven("imu", "wheels", "standstill")
    way_m = np.sum(np.hypot(*np.diff(path[:, :2], axis=0).T))
    assert way_m == pytest.approx(634.0, abs=1.0)
    assert alone_m > 1000.0
    assert unparked_m > 3.0 * both_m
    assert both_m < 0.015 * way_m
    assert np.all(np.abs(x[:2] - path[-1, :2]) < 3.0 * np.sqrt(np.diag(P)[:2]))
