"""The single-track filter on drives: steering, speed, lateral acceleration and yaw rate at 100 Hz in, sideslip out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusiond.engine.engine import Engine
from fusiond.simulation.streams import stream
from fusiond.simulation.tables import Floats, Reading, Times
from fusiond.simulation.vehicle_sensors import ACCELERATION_STD_M_S2, YAW_RATE_STD_RAD_S, Motion
from tools.pages.trials import records

EVERY = 10
"""Milliseconds between two readings."""
STEERING_STD_RAD = 0.0005
SPEED_STD_M_S = 0.1
SETTLED = 100
"""Rows left out at the start: one second."""


@dataclass(frozen=True, slots=True)
class Course:
    """What a single-track filter needs of a drive, exact, (n,) each at 100 Hz."""

    t_ns: Times
    steering_rad: Floats
    vx: Floats
    vy: Floats
    yaw_rate: Floats
    ay: Floats

    def readings(self, seed: int, with_imu: bool = True) -> list[Reading]:
        """`applied` (steering, speed) and, but for the first row, `imu` (lateral acceleration, yaw rate)."""
        told = np.column_stack((self.steering_rad, self.vx))
        told = told + [STEERING_STD_RAD, SPEED_STD_M_S] * stream(seed, "sensor/applied").standard_normal(
            told.shape
        )
        felt = np.column_stack((self.ay, self.yaw_rate))
        felt = felt + [ACCELERATION_STD_M_S2, YAW_RATE_STD_RAD_S] * stream(
            seed, "sensor/imu"
        ).standard_normal(felt.shape)
        made = [
            Reading(t, "applied", tuple(z)) for t, z in zip(self.t_ns.tolist(), told.tolist(), strict=True)
        ]
        if with_imu:
            later = zip(self.t_ns.tolist()[1:], felt.tolist()[1:], strict=True)
            made.extend(Reading(t, "imu", tuple(z)) for t, z in later)
        return made


def course_of(motion: Motion) -> Course:
    """A drive at 100 Hz; the acceleration is the mean over the 10 ms that end at the row."""
    s, rows = motion.states, slice(0, None, EVERY)
    total = np.concatenate(([0.0], np.cumsum(s[1:, 9])))
    ay = np.diff(total[rows], prepend=0.0) / EVERY
    return Course(motion.t_ns[rows], motion.steering_rad[rows], s[rows, 0], s[rows, 1], s[rows, 2], ay)


def lateral_velocity_rmse(engine: Engine, course: Course, seeds: int, with_imu: bool = True) -> float:
    """RMSE of vy, m/s, from one second on, over noise of several seeds."""
    squares = []
    for seed in range(seeds):
        engine.reset()
        batch = records(engine.layout, course.readings(seed, with_imu))
        reports = engine.process(batch[np.lexsort((batch["sensor"], batch["t_ns"]))])
        last = np.flatnonzero(np.append(np.diff(reports["t_ns"]) != 0, True))
        squares.append(np.mean((reports["x"][last, 0] - course.vy)[SETTLED:] ** 2))
    return float(np.sqrt(np.mean(squares)))
