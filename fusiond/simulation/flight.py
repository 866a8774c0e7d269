"""A small aircraft that wanders, climbs and banks: its IMU, GNSS receiver, barometer and magnetometer.

The path is a sum of sinusoids in each axis and each angle, so that velocity, acceleration and angular rate are exact
derivatives: nothing is integrated but the noise. The local frame is east, north, up; the body forward, left, up.

The start is drawn: the nominal path is moved, given a constant velocity more and turned in space (R(t) = E R_nominal(t)
with a fixed small E, which leaves the angular rate in the body as it is), so that the state at t = 0 is
N(nominal, START_STD^2) in the errors of a navigation filter: position, velocity, biases, attitude about the local axes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from fusiond.simulation.streams import stream
from fusiond.simulation.tables import Floats, Reading, Times, Truth, stamps
from fusiond.types import NANOSECONDS

GRAVITY_M_S2 = 9.80665
STEP_NS = 1_000_000
IMU_NS, GNSS_NS, FIELD_NS = 10_000_000, 200_000_000, 50_000_000
GYRO_STD_RAD_S, FORCE_STD_M_S2 = 0.01, 0.1
"""Of one IMU reading, white."""
GYRO_WALK, FORCE_WALK = 1e-4, 1e-3
"""Random walks of the biases, rad/s and m/s^2 a root of a second."""
POSITION_STD_M = np.array([0.5, 0.5, 1.0])
VELOCITY_STD_M_S = np.array([0.1, 0.1, 0.15])
ALTITUDE_STD_M = 0.3
EARTH_FIELD_UT = np.array([1.0, 21.5, -43.0])
FIELD_STD_UT = 0.5
ANTENNA_M = np.array([0.3, -0.1, 0.2])
"""From the IMU, in the body."""
START_STD = np.repeat([1.0, 0.3, 0.005, 0.05, 0.03], 3)
"""Position m, velocity m/s, gyro bias rad/s, accelerometer bias m/s^2, attitude rad."""


@dataclass(frozen=True, slots=True)
class Waves:
    """sum_k a_k sin(w_k t + f_k), axis by axis; all arrays (waves, 3)."""

    amplitude: Floats
    omega_rad_s: Floats
    phase_rad: Floats

    def at(self, t_s: Floats, derivative: int = 0) -> Floats:
        """(n, 3) the signal or a derivative of it."""
        angle = t_s[:, None, None] * self.omega_rad_s + self.phase_rad + 0.5 * np.pi * derivative
        waves = self.amplitude * self.omega_rad_s**derivative * np.sin(angle)
        return np.asarray(waves.sum(axis=1), dtype=np.float64)


PATH = Waves(
    np.array([[40.0, 30.0, 5.0], [10.0, 12.0, 2.0]]),
    np.array([[0.25, 0.2, 0.3], [0.6, 0.7, 0.5]]),
    np.array([[0.0, 1.0, 2.0], [0.5, 2.5, 1.5]]),
)
ANGLES = Waves(
    np.array([[0.3, 0.15, 2.0], [0.1, 0.1, 0.3]]),
    np.array([[0.7, 0.5, 0.3], [1.7, 1.3, 1.1]]),
    np.array([[0.0, 1.0, 0.3], [0.3, 2.0, 1.0]]),
)
"""Roll, pitch, yaw (z-y-x), rad: pitch stays within 0.25."""


@dataclass(frozen=True, slots=True)
class Motion:
    """What was so at times t_ns (n,): local position, velocity, acceleration; body rate; R (n) body to local."""

    t_ns: Times
    position_m: Floats
    velocity_m_s: Floats
    acceleration_m_s2: Floats
    rate_rad_s: Floats
    attitude: Rotation

    def force_m_s2(self) -> Floats:
        """(n, 3) specific force in the body: R' (a - g)."""
        felt = self.acceleration_m_s2 + np.array([0.0, 0.0, GRAVITY_M_S2])
        return np.asarray(self.attitude.apply(felt, inverse=True))


def motion(t_ns: Times, error: Floats) -> Motion:
    """The path that starts off the nominal one by `error` (15,) (position, velocity, -, -, attitude)."""
    t_s = t_ns / NANOSECONDS
    roll, pitch, yaw = ANGLES.at(t_s).T
    droll, dpitch, dyaw = ANGLES.at(t_s, 1).T
    nominal = Rotation.from_euler("ZYX", np.column_stack((yaw, pitch, roll)))
    rate = np.column_stack(
        (
            droll - dyaw * np.sin(pitch),
            dpitch * np.cos(roll) + dyaw * np.sin(roll) * np.cos(pitch),
            -dpitch * np.sin(roll) + dyaw * np.cos(roll) * np.cos(pitch),
        )
    )
    return Motion(
        t_ns,
        PATH.at(t_s) + error[:3] + t_s[:, None] * error[3:6],
        PATH.at(t_s, 1) + error[3:6],
        PATH.at(t_s, 2),
        rate,
        Rotation.from_rotvec(error[12:]) * nominal,
    )


def nominal_start() -> dict[str, float]:
    """What a filter is told about t = 0, by state name with unit."""
    begin = motion(np.zeros(1, dtype=np.int64), np.zeros(15))
    x, y, z, w = begin.attitude.as_quat()[0]
    values = (*begin.position_m[0], *begin.velocity_m_s[0], w, x, y, z)
    names = ("x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s", "qw", "qx", "qy", "qz")
    return {name: float(value) for name, value in zip(names, values, strict=True)}


def flight(seed: int, duration_ns: int, *, noise: float = 1.0) -> tuple[list[Reading], Truth]:
    """One flight. Stamps of all sensors coincide with an IMU reading's.

    An `imu` reading is the mean over the 10 ms that end at its stamp. `noise` scales every error, the start's too: 0
    leaves only what averaging over 10 ms does. Truth: the states of a strapdown filter every 10 ms, qw >= 0 anywhere.
    """
    error = noise * START_STD * stream(seed, "start").standard_normal(15)
    t_ns = stamps(duration_ns, IMU_NS)
    was = motion(t_ns, error)
    walk = stream(seed, "bias").standard_normal((t_ns.size - 1, 6))
    steps = noise * np.repeat([GYRO_WALK, FORCE_WALK], 3) * np.sqrt(IMU_NS / NANOSECONDS) * walk
    biases = error[6:12] + np.vstack((np.zeros((1, 6)), np.cumsum(steps, axis=0)))
    readings = _imu(seed, was.t_ns, error, biases, noise) + _aiding(seed, was, noise)
    quaternion = was.attitude.as_quat(canonical=True)
    columns = (was.position_m, was.velocity_m_s, biases, quaternion[:, [3, 0, 1, 2]])
    return readings, Truth(t_ns, TRUTH, np.column_stack(columns))


TRUTH = (
    "x", "y", "z", "vx", "vy", "vz", "gyro_bias_x", "gyro_bias_y", "gyro_bias_z",
    "accel_bias_x", "accel_bias_y", "accel_bias_z", "qw", "qx", "qy", "qz",
)  # fmt: skip


def _imu(seed: int, t_ns: Times, error: Floats, biases: Floats, noise: float) -> list[Reading]:
    """Means of rate and force at the middles of every millisecond, with the bias of the interval's start."""
    each = IMU_NS // STEP_NS
    middles = np.arange(t_ns.size * each, dtype=np.int64) * STEP_NS + STEP_NS // 2 - IMU_NS
    fine = motion(middles, error)
    exact = np.column_stack((fine.rate_rad_s, fine.force_m_s2()))
    means = exact.reshape(-1, each, 6).mean(axis=1)
    stds = noise * np.repeat([GYRO_STD_RAD_S, FORCE_STD_M_S2], 3)
    white = stds * stream(seed, "sensor/imu").standard_normal(means.shape)
    values = means + np.vstack((biases[:1], biases[:-1])) + white
    return _rows("imu", t_ns, values)


def _aiding(seed: int, was: Motion, noise: float) -> list[Reading]:
    """GNSS position and velocity of the antenna, barometer and magnetometer, from their first period on."""
    arm = was.attitude.apply(ANTENNA_M)
    swing = was.attitude.apply(np.cross(was.rate_rad_s, ANTENNA_M))
    field = was.attitude.apply(np.tile(EARTH_FIELD_UT, (was.t_ns.size, 1)), inverse=True)
    exact = (
        ("gnss_position", GNSS_NS, was.position_m + arm, POSITION_STD_M),
        ("gnss_velocity", GNSS_NS, was.velocity_m_s + swing, VELOCITY_STD_M_S),
        ("barometer", FIELD_NS, was.position_m[:, 2:], np.array([ALTITUDE_STD_M])),
        ("magnetometer", FIELD_NS, field, np.full(3, FIELD_STD_UT)),
    )
    readings: list[Reading] = []
    for name, period_ns, values, std in exact:
        every = slice(period_ns // IMU_NS, None, period_ns // IMU_NS)
        drawn = stream(seed, f"sensor/{name}").standard_normal(values[every].shape)
        readings += _rows(name, was.t_ns[every], values[every] + noise * std * drawn)
    return readings


def _rows(name: str, t_ns: Times, values: Floats) -> list[Reading]:
    """Readings from columns."""
    return [Reading(t, name, tuple(z)) for t, z in zip(t_ns.tolist(), values.tolist(), strict=True)]
