"""Seed 002's vehicle equations as a plant: a rigid body pushed at its four wheels, many cars at once.

Written from the rigid body (1) and the sums over wheels (3), with every wheel's force turned by its own steering and
its moment taken about the centre of gravity as r x F. The seed's printed (2) and (6) are not used, so this decides
about their signs. Stepped as the seed steps (11), so that an estimator of the same equations meets exactly its own
model: the specific force of a step is what its first instant has.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusiond.simulation.tables import Floats

COLUMNS = ("vx", "vy", "yaw_rate", "force_front", "force_rear", "yaw", "x", "y", "ax", "ay")


@dataclass(frozen=True, slots=True)
class Car:
    """What pushes what. The numbers are those of the BMW 320i of commonroad-vehicle-models."""

    mass_kg: float = 1093.295
    yaw_inertia_kg_m2: float = 1791.6
    front_m: float = 1.15620
    rear_m: float = 1.42272
    track_m: float = 1.37541
    drag_area_m2: float = 0.0
    air_density_kg_m3: float = 1.225

    def wheels_m(self) -> Floats:
        """(4, 2) where the wheels stand, in the body: front left, front right, rear left, rear right."""
        half = 0.5 * self.track_m
        return np.array(
            [[self.front_m, half], [self.front_m, -half], [-self.rear_m, half], [-self.rear_m, -half]]
        )

    def push(self, drive_n: Floats, lateral_n: Floats, steering_rad: Floats, v_m_s: Floats) -> Floats:
        """(runs, 3) specific forces along and across, m/s^2, and yaw acceleration, rad/s^2.

        Args:
            drive_n: (runs, 4) along each wheel.   lateral_n: (runs, 2) of each axle, to the left of its wheels.
            steering_rad: (runs,) of the front wheels.   v_m_s: (runs, 2) velocity, for the drag.
        """
        angle = np.stack((steering_rad, steering_rad, 0.0 * steering_rad, 0.0 * steering_rad), axis=1)
        side = np.repeat(0.5 * lateral_n, 2, axis=1)
        ahead = drive_n * np.cos(angle) - side * np.sin(angle)
        across = drive_n * np.sin(angle) + side * np.cos(angle)
        places = self.wheels_m()
        moment = np.sum(places[:, 0] * across - places[:, 1] * ahead, axis=1)
        drag = 0.5 * self.air_density_kg_m3 * self.drag_area_m2 * np.sum(v_m_s**2, axis=1)
        return np.column_stack(
            (
                (ahead.sum(axis=1) - drag) / self.mass_kg,
                across.sum(axis=1) / self.mass_kg,
                moment / self.yaw_inertia_kg_m2,
            )
        )


@dataclass(frozen=True, slots=True)
class Disturbance:
    """What the equations leave open.

    lateral_force_n_sqrt_s: random walk of each axle's force.   specific_force: white, (m/s^2)/sqrt(Hz), along and
    across; the accelerometer feels it.   yaw_acceleration: white, (rad/s^2)/sqrt(Hz).
    """

    lateral_force_n_sqrt_s: float
    specific_force: float
    yaw_acceleration: float


def advance(s: Floats, after: Floats, pushed: Floats, dt_s: float) -> None:
    """One step (11) of the body, s to after, both (runs, 10); pushed as `Car.push` gives it. Leaves the axle forces."""
    after[:, 8:] = pushed[:, :2]
    after[:, 0] = s[:, 0] + dt_s * (pushed[:, 0] + s[:, 1] * s[:, 2])
    after[:, 1] = s[:, 1] + dt_s * (pushed[:, 1] - s[:, 0] * s[:, 2])
    after[:, 2] = s[:, 2] + dt_s * pushed[:, 2]
    after[:, 5] = s[:, 5] + dt_s * s[:, 2]
    cosine, sine = np.cos(s[:, 5]), np.sin(s[:, 5])
    after[:, 6] = s[:, 6] + dt_s * (s[:, 0] * cosine - s[:, 1] * sine)
    after[:, 7] = s[:, 7] + dt_s * (s[:, 0] * sine + s[:, 1] * cosine)


def drive(
    car: Car,
    disturbance: Disturbance,
    start: Floats,
    drive_n: Floats,
    steering_rad: Floats,
    lateral_n: Floats | None,
    dt_s: float,
    rng: np.random.Generator,
) -> Floats:
    """(steps + 1, runs, 10) states in the order of COLUMNS, yaw unwrapped; ax and ay are those of the step before.

    Args:
        start: (runs, 8) vx, vy, yaw rate, the axle forces, yaw, x, y.
        drive_n: (steps, 4) wheel forces and steering_rad: (steps,) front angle, held over each step, of every run.
        lateral_n: (steps + 1, 2) axle forces to be imposed; None lets them wander from their start.
    """
    steps, runs = steering_rad.size, start.shape[0]
    states = np.zeros((steps + 1, runs, 10))
    states[0, :, :8] = start
    if lateral_n is not None:
        states[0, :, 3:5] = lateral_n[0]
    root = np.sqrt(dt_s)
    for k in range(steps):
        s, after = states[k], states[k + 1]
        noise = rng.standard_normal((runs, 5))
        wheels = np.broadcast_to(drive_n[k], (runs, 4))
        pushed = car.push(wheels, s[:, 3:5], np.full(runs, steering_rad[k]), s[:, :2])
        pushed[:, :2] += disturbance.specific_force / root * noise[:, :2]
        advance(s, after, pushed, dt_s)
        after[:, 2] += disturbance.yaw_acceleration * root * noise[:, 2]
        wander = disturbance.lateral_force_n_sqrt_s * root * noise[:, 3:]
        after[:, 3:5] = s[:, 3:5] + wander if lateral_n is None else lateral_n[k + 1]
    return states
