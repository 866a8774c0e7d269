"""A point in the plane at constant velocity, disturbed by accelerations.

    x' = vx, y' = vy, vx' = ax, vy' = ay

`noise = "steps"`: the acceleration is constant over each interval, variance sigma^2 (Q = G G' sigma^2,
G = [dt^2/2, dt]), the convention of most courses; the estimate then depends on how time is cut into intervals.
`noise = "white"`: white acceleration, exactly integrated.
"""

from __future__ import annotations

import math
from typing import Literal

from fusiond.models.contract import Process
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot


def describe(*, acceleration_noise_m_s2: float, noise: Literal["white", "steps"] = "white") -> Process:
    """Describe the model.

    Args:
        acceleration_noise_m_s2: std of the acceleration on each axis: m/s^2 held over an interval ("steps"),
            or (m/s^2)/sqrt(Hz) ("white").
        noise: see above.
    """
    return Process(
        states=(Slot("x", "m"), Slot("y", "m"), Slot("vx", "m_s"), Slot("vy", "m_s")),
        noises=4,
        parameters=(acceleration_noise_m_s2**2, 1.0 if noise == "steps" else 0.0),
        linear=True,
        outputs=(Slot("speed", "m_s"), Slot("course", "rad")),
    )


@kernel
def discretise(dt_s: float, p: Vector, F: Matrix, B: Matrix, c: Vector, G: Matrix, q: Vector) -> None:
    """Exact for either noise; each axis has two noise columns."""
    for i in range(4):
        F[i, i] = 1.0
    for axis in range(2):
        F[axis, axis + 2] = dt_s
        if p[1] > 0.0:
            G[axis, axis] = 0.5 * dt_s * dt_s
            G[axis + 2, axis] = dt_s
            q[axis] = p[0]
            q[axis + 2] = 0.0
        else:
            G[axis, axis] = 1.0
            G[axis, axis + 2] = 0.5 * dt_s
            G[axis + 2, axis + 2] = 1.0
            q[axis] = p[0] * dt_s**3 / 12.0
            q[axis + 2] = p[0] * dt_s


@kernel
def derive(x: Vector, p: Vector, y: Vector) -> None:
    """Speed and course (from x towards y)."""
    y[0] = (x[2] * x[2] + x[3] * x[3]) ** 0.5
    y[1] = math.atan2(x[3], x[2])
