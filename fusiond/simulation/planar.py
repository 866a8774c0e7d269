"""A vehicle in the plane: a unicycle whose speed and yaw rate wander.

x' = v cos yaw,   y' = v sin yaw,   yaw' = omega,   v' and omega' random
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fusiond.simulation.tables import Floats, Times, stamps
from fusiond.types import NANOSECONDS


class PlanarState(NamedTuple):
    """Pose in the map (x east, y north, yaw from x to y, unwrapped), motion along the body, gyro bias."""

    x_m: float
    y_m: float
    yaw_rad: float
    speed_m_s: float
    yaw_rate_rad_s: float
    gyro_bias_rad_s: float


START = PlanarState(20.0, 10.0, 0.5, 5.0, 0.0, 0.0)
START_STD = PlanarState(1.0, 1.0, 0.1, 0.5, 0.05, 0.02)


@dataclass(frozen=True, slots=True)
class PlanarVehicle:
    """Motion and start of the vehicle.

    motion "white_acceleration": speed and yaw rate are integrals of white noise of these intensities, hence
    continuous, and what a constant-turn-rate-and-velocity filter assumes: its consistency can be promised.
    motion "smooth": both are sums of five seeded sinusoids with periods of 5 to 30 s, and no filter's model.
    The start is drawn from N(start, start_std^2); the gyro bias is constant over a run.
    Integration: trapezoids, every step_ns.
    """

    motion: str = "white_acceleration"
    acceleration_intensity: float = 0.05  # (m/s^2)^2 s
    yaw_acceleration_intensity: float = 0.002  # (rad/s^2)^2 s
    smooth_rms: tuple[float, float] = (1.5, 0.2)  # m/s, rad/s
    start: PlanarState = START
    start_std: PlanarState = START_STD
    step_ns: int = 1_000_000

    def trajectory(self, duration_ns: int, rng: np.random.Generator) -> tuple[Times, Floats]:
        """Times (n,) and states (n, 6) in the order of PlanarState, every step_ns."""
        t_ns = stamps(duration_ns, self.step_ns)
        t_s = t_ns / NANOSECONDS
        drawn = np.array(self.start) + np.array(self.start_std) * rng.standard_normal(6)
        start = PlanarState(*drawn.tolist())
        wander = self._wander(t_s, rng)
        speed, yaw_rate = start.speed_m_s + wander[:, 0], start.yaw_rate_rad_s + wander[:, 1]
        yaw = start.yaw_rad + _integral(yaw_rate, t_s)
        x = start.x_m + _integral(speed * np.cos(yaw), t_s)
        y = start.y_m + _integral(speed * np.sin(yaw), t_s)
        bias = np.full(t_s.size, start.gyro_bias_rad_s)
        return t_ns, np.column_stack((x, y, yaw, speed, yaw_rate, bias))

    def _wander(self, t_s: Floats, rng: np.random.Generator) -> Floats:
        """(n, 2) changes of speed and yaw rate since the start. A longer run begins like a shorter one."""
        if self.motion == "white_acceleration":
            intensities = np.array([self.acceleration_intensity, self.yaw_acceleration_intensity])
            steps = np.sqrt(intensities * self.step_ns / NANOSECONDS) * rng.standard_normal((t_s.size - 1, 2))
            return np.vstack((np.zeros((1, 2)), np.cumsum(steps, axis=0)))
        period_s = rng.uniform(5.0, 30.0, (5, 1, 2))
        phase = rng.uniform(0.0, 2.0 * np.pi, (5, 1, 2))
        waves = np.sin(2.0 * np.pi * t_s[:, None] / period_s + phase) - np.sin(phase)
        amplitudes = np.sqrt(2.0 / 5.0) * np.array(self.smooth_rms)
        return np.asarray(waves.sum(axis=0) * amplitudes, dtype=np.float64)


def _integral(rate: Floats, t_s: Floats) -> Floats:
    """(n,) the integral of a rate from t_s[0] on."""
    from scipy.integrate import cumulative_trapezoid  # slow to load, and a live point plant has no use for it

    return np.asarray(cumulative_trapezoid(rate, t_s, initial=0), dtype=np.float64)
