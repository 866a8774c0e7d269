"""What the sensors of seed 002's car make of its motion, with the noise of the seed's table I.

applied        1 kHz   four wheel forces, 5 % noise, and the steering, exact (the seed gives it no noise)
imu            1 kHz   specific forces averaged over the millisecond that ends at the stamp, and yaw rate
gps             10 Hz  speed, course, position
magnetometer    10 Hz  yaw
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusiond.simulation.faults_injection import Measured
from fusiond.simulation.streams import stream
from fusiond.simulation.tables import Floats, Reading, Times, Truth

MILLISECOND_NS = 1_000_000
SLOW = 100
"""Milliseconds between two readings of gps and magnetometer."""
ACCELERATION_STD_M_S2 = 0.025
YAW_RATE_STD_RAD_S = 0.002
SPEED_STD_M_S = 0.1
COURSE_STD_RAD = 0.01
POSITION_STD_M = 0.1
HEADING_STD_RAD = 0.01
FORCE_SHARE = 0.05
MEASURED = (
    Measured("applied", 5),
    Measured("imu", 3, sigma=(ACCELERATION_STD_M_S2, ACCELERATION_STD_M_S2, YAW_RATE_STD_RAD_S)),
    Measured(
        "gps", 4, sigma=(SPEED_STD_M_S, COURSE_STD_RAD, POSITION_STD_M, POSITION_STD_M), angles=frozenset({1})
    ),
    Measured("magnetometer", 1, sigma=(HEADING_STD_RAD,), angles=frozenset({0})),
)
"""What whoever lets them lie must know; the noise of a force is a share of it, no number of its own."""


@dataclass(frozen=True, slots=True)
class Motion:
    """One drive, a row a millisecond.

    states: (n, 10) vx, vy, yaw rate, axle forces front and rear, yaw (unwrapped), x, y, and the mean specific forces
    along and across of the millisecond that ended.   drive_n: (n, 4), steering_rad: (n,) held from the row on.
    """

    t_ns: Times
    states: Floats
    drive_n: Floats
    steering_rad: Floats

    def truth(self, names: tuple[str, ...]) -> Truth:
        """The states under the names of their columns."""
        return Truth(self.t_ns, names, self.states)


def wrapped(angle_rad: Floats) -> Floats:
    """The same angles in [-pi, pi)."""
    return np.asarray((angle_rad + np.pi) % (2.0 * np.pi) - np.pi, dtype=np.float64)


def readings(motion: Motion, seed: int, force_std_n: float | None = None) -> list[Reading]:
    """Every sensor's readings of one drive, each sensor by its own stream of the seed.

    Args:
        force_std_n: noise of a wheel's force; None for 5 % of its size.
    """
    states, t_ns = motion.states, motion.t_ns.tolist()
    made: list[Reading] = []
    std_n = FORCE_SHARE * np.abs(motion.drive_n) if force_std_n is None else force_std_n
    told = motion.drive_n + std_n * stream(seed, "sensor/applied").standard_normal(motion.drive_n.shape)
    applied = np.column_stack((told, motion.steering_rad)).tolist()
    made.extend(Reading(t, "applied", tuple(z)) for t, z in zip(t_ns, applied, strict=True))
    std = np.array([ACCELERATION_STD_M_S2, ACCELERATION_STD_M_S2, YAW_RATE_STD_RAD_S])
    felt = states[:, [8, 9, 2]] + std * stream(seed, "sensor/imu").standard_normal((len(t_ns), 3))
    made.extend(
        Reading(t, "imu", tuple(z)) for t, z in zip(t_ns[1:], felt[1:].tolist(), strict=True)
    )  # before the first row there is no interval
    slow, slow_ns = states[::SLOW], t_ns[::SLOW]
    made.extend(_gps(slow, slow_ns, seed))
    heading = slow[:, 5] + HEADING_STD_RAD * stream(seed, "sensor/magnetometer").standard_normal(len(slow_ns))
    made.extend(
        Reading(t, "magnetometer", (z,)) for t, z in zip(slow_ns, wrapped(heading).tolist(), strict=True)
    )
    return made


def _gps(slow: Floats, slow_ns: list[int], seed: int) -> list[Reading]:
    """Speed, course and position of the rows given."""
    exact = np.column_stack(
        (np.hypot(slow[:, 0], slow[:, 1]), slow[:, 5] + np.arctan2(slow[:, 1], slow[:, 0]), slow[:, 6:8])
    )
    std = np.array([SPEED_STD_M_S, COURSE_STD_RAD, POSITION_STD_M, POSITION_STD_M])
    z = exact + std * stream(seed, "sensor/gps").standard_normal(exact.shape)
    z[:, 1] = wrapped(z[:, 1])
    return [Reading(t, "gps", tuple(row)) for t, row in zip(slow_ns, z.tolist(), strict=True)]
