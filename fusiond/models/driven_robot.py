"""A robot in the plane, driven by its measured speed and yaw rate: wheel odometry, or wheels and a gyro.

    x' = speed cos(yaw), y' = speed sin(yaw), yaw' = yaw_rate,   constants: random walks

Speed and yaw rate are inputs, so their noise enters as it is measured and they need no state. `constants` are unknown
numbers that the sensors know by name, such as the scale of a kind of ranges (`beacon_range`, `scale_state`). Angles are
counter-clockwise from the x axis, rad.
"""

from __future__ import annotations

import math

from fusiond.errors import ConfigError
from fusiond.models.contract import Process
from fusiond.numerics.discretise import wrap_angle
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot

POSE = (Slot("x", "m"), Slot("y", "m"), Slot("yaw", "rad"))


def describe(
    *,
    constants: list[str] | None = None,
    constant_noise_sqrt_s: float = 0.0,
    position_noise_m_sqrt_s: float = 0.0,
    max_step_s: float = 0.1,
) -> Process:
    """Describe the model.

    Args:
        constants: names of further states that do not move, without a unit.
        constant_noise_sqrt_s: random walk of each of them.
        position_noise_m_sqrt_s: random walk of x and y, for what odometry does not see (slip, a drifting frame).
        max_step_s: longest interval of one prediction.
    """
    names = constants or []
    for name in names:
        if names.count(name) > 1 or name in {slot.name for slot in POSE}:
            raise ConfigError(f"constants: `{name}` is a state already; name each constant once")
    return Process(
        states=(*POSE, *(Slot(name) for name in names)),
        inputs=(Slot("speed", "m_s"), Slot("yaw_rate", "rad_s")),
        noises=2 + len(names),
        parameters=(position_noise_m_sqrt_s**2, constant_noise_sqrt_s**2),
        angles=("yaw",),
        max_step_s=max_step_s,
    )


@kernel
def transition(x: Vector, u: Vector, dt_s: float, p: Vector, x_next: Vector, F: Matrix, B: Matrix) -> None:
    """Move along the heading of mid-interval: second order in dt, and smooth at zero yaw rate."""
    middle = x[2] + 0.5 * u[1] * dt_s
    forward_x, forward_y = math.cos(middle), math.sin(middle)
    way = u[0] * dt_s
    for i in range(x.shape[0]):
        x_next[i] = x[i]
        F[i, i] = 1.0
    x_next[0] += way * forward_x
    x_next[1] += way * forward_y
    x_next[2] = wrap_angle(x[2] + u[1] * dt_s)
    F[0, 2] = -way * forward_y
    F[1, 2] = way * forward_x
    B[0, 0] = dt_s * forward_x
    B[1, 0] = dt_s * forward_y
    B[0, 1] = 0.5 * dt_s * F[0, 2]
    B[1, 1] = 0.5 * dt_s * F[1, 2]
    B[2, 1] = dt_s


@kernel
def noise(x: Vector, dt_s: float, p: Vector, G: Matrix, q: Vector) -> None:
    """Random walks of position and constants; the odometry's noise comes with its readings."""
    for i in range(2):
        G[i, i] = 1.0
        q[i] = p[0] * dt_s
    for i in range(3, x.shape[0]):
        G[i, i - 1] = 1.0
        q[i - 1] = p[1] * dt_s
