"""Seed 002's car on the road: tyres push it sideways, a driver steers the manoeuvre and keeps the speed.

    tyres    F = mu N tanh(C a / (mu N)) at each axle, a the slip angle of its wheels (Rajamani 2012, section 2.3), N
             its load at rest, C = 21.92 N; slope and friction mu are those of commonroad-vehicle-models' BMW 320i,
             the tanh that joins them is assumed
    speed    the longitudinal force is a proportional driver's: 2 / s times the speed missing, times the mass; split as
             that car's parameters say, brake 66 % in front, engine all rear, left and right alike

The body is that of `vehicle_equations`. Nothing of the tyres is known to a filter that lets the axle forces wander.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fusiond.simulation.tables import Floats
from fusiond.simulation.vehicle_equations import Car, advance
from fusiond.simulation.vehicle_manoeuvres import Manoeuvre
from fusiond.simulation.vehicle_sensors import MILLISECOND_NS, Motion
from fusiond.types import NANOSECONDS

GRAVITY_M_S2 = 9.81
DRIVER_PER_S = 2.0
BRAKE_FRONT = 0.66
STEP_S = MILLISECOND_NS / NANOSECONDS


@dataclass(frozen=True, slots=True)
class Tyres:
    """What the tyres of an axle give, each a multiple of its load: per rad of small slip, and at most."""

    slope_per_rad: float = 21.92
    friction: float = 1.0489

    def lateral_n(self, load_n: float, slip_rad: float) -> float:
        """Force of one axle to the left of its wheels; slip is how far they point to the left of where they go."""
        most_n = self.friction * load_n
        return most_n * math.tanh(self.slope_per_rad * load_n * slip_rad / most_n)

    def axles_n(self, car: Car, body: tuple[float, float, float], steering_rad: float) -> tuple[float, float]:
        """Front and rear, of a body that moves with vx > 0, vy and yaw rate."""
        vx, vy, rate = body
        weight_n = car.mass_kg * GRAVITY_M_S2 / (car.front_m + car.rear_m)
        front_rad = steering_rad - math.atan2(vy + car.front_m * rate, vx)
        rear_rad = -math.atan2(vy - car.rear_m * rate, vx)
        return (
            self.lateral_n(weight_n * car.rear_m, front_rad),
            self.lateral_n(weight_n * car.front_m, rear_rad),
        )


def wheel_forces_n(car: Car, missing_m_s: float) -> tuple[float, float, float, float]:
    """Front left, front right, rear left, rear right: what the driver answers to speed that is missing."""
    half_n = 0.5 * car.mass_kg * DRIVER_PER_S * missing_m_s
    front = BRAKE_FRONT if missing_m_s < 0.0 else 0.0
    return front * half_n, front * half_n, (1.0 - front) * half_n, (1.0 - front) * half_n


def follow(asked: Manoeuvre, steps: int, car: Car | None = None, tyres: Tyres | None = None) -> Motion:
    """So many milliseconds from the start, straight ahead at its speed; after the manoeuvre it goes on as it ends."""
    car, tyres = car or Car(), tyres or Tyres()
    states, drive_n = np.zeros((steps + 1, 1, 10)), np.zeros((steps + 1, 4))
    steering_rad: Floats = np.array([asked.steering_rad(k * STEP_S) for k in range(steps + 1)])
    states[0, 0, 0] = asked.speed_m_s
    for k in range(steps + 1):
        s = states[k]
        vx, vy, rate = s[0, :3].tolist()
        s[0, 3:5] = tyres.axles_n(car, (vx, vy, rate), float(steering_rad[k]))
        drive_n[k] = wheel_forces_n(car, asked.speed_m_s - vx)
        if k < steps:
            pushed = car.push(drive_n[k : k + 1], s[:, 3:5], steering_rad[k : k + 1], s[:, :2])
            advance(s, states[k + 1], pushed, STEP_S)
    t_ns = np.arange(steps + 1, dtype=np.int64) * MILLISECOND_NS
    return Motion(t_ns, states[:, 0], drive_n, steering_rad)
