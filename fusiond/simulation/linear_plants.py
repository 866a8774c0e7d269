"""Linear plants driven by noise: the reference plant and the constant-velocity plant.

Both by a route that is not the filters': the first by scipy's dlsim, the second by summing accelerations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusiond.simulation.tables import Floats


@dataclass(frozen=True, slots=True)
class ReferencePlant:
    """x(k+1) = A x(k) + B (u(k) + w(k)),  w ~ N(0, Q),  u(k) = sin(k / 5),  y = C x.

    The noise enters through the input matrix (seed 004, eq 1-1, with B (u + w) for the printed B w); one
    step is one second. x(0) ~ N(0, B Q B'), which is the seed's first prior, eq 2-1.
    """

    Q: float = 2.3
    A: tuple[tuple[float, ...], ...] = ((1.1269, -0.4940, 0.1129), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    B: tuple[float, ...] = (-0.3832, 0.5919, 0.5191)
    C: tuple[float, ...] = (1.0, 0.0, 0.0)

    def input(self, steps: int) -> Floats:
        """(steps + 1,) the known input u(0), u(1), ..."""
        return np.sin(np.arange(steps + 1) / 5.0)

    def trajectory(self, steps: int, rng: np.random.Generator) -> Floats:
        """(steps + 1, 3) the states x(0) ... x(steps)."""
        from scipy.signal import dlsim  # half a second to load, which a live plant need not wait for

        noise = np.sqrt(self.Q) * rng.standard_normal(steps + 2)
        a, b = np.array(self.A), np.array(self.B)[:, None]
        system = (a, b, np.array(self.C)[None, :], np.zeros((1, 1)), 1.0)
        _, _, states = dlsim(system, (self.input(steps) + noise[1:])[:, None], x0=b[:, 0] * noise[0])
        return np.asarray(states, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class ConstantVelocityPlant:
    """Velocity changed only by an acceleration that is held over a step and white between steps, a ~ N(0, q).

        p(k+1) = p(k) + v(k) dt + a(k) dt^2 / 2,      v(k+1) = v(k) + a(k) dt

    which is A = [1 dt; 0 1], Q = q G G', G = [dt^2/2, dt]' = [0.005, 0.1]'. The start is drawn from
    N(start, start_std^2).
    """

    q: float = 1.0
    dt_s: float = 0.1
    start: tuple[float, float] = (0.0, 0.0)
    start_std: tuple[float, float] = (1.0, 1.0)

    def trajectory(self, steps: int, rng: np.random.Generator) -> Floats:
        """(steps + 1, 2) position (m) and velocity (m/s)."""
        position_0, velocity_0 = np.array(self.start) + np.array(self.start_std) * rng.standard_normal(2)
        gained = self.dt_s * np.sqrt(self.q) * rng.standard_normal(steps)
        velocity = velocity_0 + np.concatenate(([0.0], np.cumsum(gained)))
        moved = self.dt_s * 0.5 * (velocity[:-1] + velocity[1:])
        return np.column_stack((position_0 + np.concatenate(([0.0], np.cumsum(moved))), velocity))
