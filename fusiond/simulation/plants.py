"""Plants moved by a force: the mini car and the bi-rotor of seed 000, and the wall robot of seed 001.

    mini car (eq 22)   m x'' = u            m = 1 kg,   x(0) = 0,  x'(0) = 0
    bi-rotor (eq 26)   m z'' = u - m g      m = 0.5 kg, z(0) = 2,  z'(0) = 0,  g = 9.81

The force is held over a step; the step is integrated by Runge-Kutta 4 on a finer grid. There is no ground
under the bi-rotor and no wall before the car: the seed has none.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fusiond.simulation.tables import Floats


class PointState(NamedTuple):
    """A point on a line. The acceleration is the mean over the step that ended here (0 before the first)."""

    position_m: float
    velocity_m_s: float
    acceleration_m_s2: float


@dataclass(frozen=True, slots=True)
class PointPlant:
    """m x'' = u - m g - c x': a point mass on a line, pushed by u (N).

    drag_n_s_per_m is 0 in the seed ("friction ... has been omitted").
    """

    mass_kg: float
    start: PointState
    gravity_m_s2: float = 0.0
    drag_n_s_per_m: float = 0.0
    substep_s: float = 2.5e-4

    @property
    def weight_n(self) -> float:
        """The force that holds the plant still."""
        return self.mass_kg * self.gravity_m_s2

    def acceleration(self, velocity_m_s: float, force_n: float) -> float:
        """x'' in m/s^2."""
        return (force_n - self.drag_n_s_per_m * velocity_m_s) / self.mass_kg - self.gravity_m_s2

    def advance(self, state: PointState, force_n: float, dt_s: float) -> PointState:
        """The state dt_s later under a constant force; its acceleration is the mean over those dt_s."""
        steps = max(1, math.ceil(dt_s / self.substep_s - 1e-9))
        h_s = dt_s / steps
        position, velocity = state.position_m, state.velocity_m_s
        for _ in range(steps):
            position, velocity = self._runge_kutta(position, velocity, force_n, h_s)
        return PointState(position, velocity, (velocity - state.velocity_m_s) / dt_s)

    def _runge_kutta(self, x: float, v: float, force_n: float, h_s: float) -> tuple[float, float]:
        half_s = 0.5 * h_s
        a1 = self.acceleration(v, force_n)
        v2 = v + half_s * a1
        a2 = self.acceleration(v2, force_n)
        v3 = v + half_s * a2
        a3 = self.acceleration(v3, force_n)
        v4 = v + h_s * a3
        a4 = self.acceleration(v4, force_n)
        return x + h_s / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4), v + h_s / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)


MINI_CAR = PointPlant(mass_kg=1.0, start=PointState(0.0, 0.0, 0.0))
BI_ROTOR = PointPlant(mass_kg=0.5, start=PointState(2.0, 0.0, 0.0), gravity_m_s2=9.81)


def wall_robot_position(t_s: Floats) -> Floats:
    """Seed 001's prescribed path x = 0.05 t cos 2t, in metres."""
    return np.asarray(0.05 * t_s * np.cos(2.0 * t_s), dtype=np.float64)


def wall_robot_velocity(t_s: Floats) -> Floats:
    """Its derivative, 0.05 cos 2t - 0.1 t sin 2t, in m/s."""
    return np.asarray(0.05 * np.cos(2.0 * t_s) - 0.1 * t_s * np.sin(2.0 * t_s), dtype=np.float64)
