"""A robot in the plane: pose, speed along its heading, yaw rate, and the bias of its gyro.

    x' = speed cos(yaw), y' = speed sin(yaw), yaw' = yaw_rate
    speed' = white, yaw_rate' = white, gyro_bias' = white

The reading of a `yaw_rate` sensor is yaw_rate + gyro_bias. Angles are counter-clockwise from the x axis, rad.
"""

from __future__ import annotations

import math

from fusiond.models.contract import Process
from fusiond.numerics.discretise import wrap_angle
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot


def describe(
    *,
    acceleration_noise_m_s2_sqrt_hz: float,
    yaw_acceleration_noise_rad_s2_sqrt_hz: float,
    gyro_bias_noise_rad_s_sqrt_s: float = 0.0,
    max_step_s: float = 0.1,
) -> Process:
    """Describe the model.

    Args:
        acceleration_noise_m_s2_sqrt_hz: white acceleration along the heading.
        yaw_acceleration_noise_rad_s2_sqrt_hz: white yaw acceleration.
        gyro_bias_noise_rad_s_sqrt_s: random walk of the gyro's bias.
        max_step_s: longest interval of one prediction.
    """
    return Process(
        states=(
            Slot("x", "m"),
            Slot("y", "m"),
            Slot("yaw", "rad"),
            Slot("speed", "m_s"),
            Slot("yaw_rate", "rad_s"),
            Slot("gyro_bias", "rad_s"),
        ),
        noises=3,
        parameters=(
            acceleration_noise_m_s2_sqrt_hz**2,
            yaw_acceleration_noise_rad_s2_sqrt_hz**2,
            gyro_bias_noise_rad_s_sqrt_s**2,
        ),
        angles=("yaw",),
        outputs=(Slot("vx", "m_s"), Slot("vy", "m_s")),
        max_step_s=max_step_s,
    )


@kernel
def transition(x: Vector, u: Vector, dt_s: float, p: Vector, x_next: Vector, F: Matrix, B: Matrix) -> None:
    """Move at constant speed along the heading at mid-interval: second order in dt, and smooth at zero yaw rate."""
    middle = x[2] + 0.5 * x[4] * dt_s
    forward_x, forward_y = math.cos(middle), math.sin(middle)
    way = x[3] * dt_s
    x_next[0] = x[0] + way * forward_x
    x_next[1] = x[1] + way * forward_y
    x_next[2] = wrap_angle(x[2] + x[4] * dt_s)
    x_next[3] = x[3]
    x_next[4] = x[4]
    x_next[5] = x[5]
    for i in range(6):
        F[i, i] = 1.0
    F[0, 2] = -way * forward_y
    F[1, 2] = way * forward_x
    F[0, 3] = dt_s * forward_x
    F[1, 3] = dt_s * forward_y
    F[0, 4] = -0.5 * way * dt_s * forward_y
    F[1, 4] = 0.5 * way * dt_s * forward_x
    F[2, 4] = dt_s


@kernel
def noise(x: Vector, dt_s: float, p: Vector, G: Matrix, q: Vector) -> None:
    """Accelerations integrated over the interval: held, with the variance that white noise gives the speeds."""
    half = 0.5 * dt_s
    G[0, 0] = half * math.cos(x[2])
    G[1, 0] = half * math.sin(x[2])
    G[3, 0] = 1.0
    G[2, 1] = half
    G[4, 1] = 1.0
    G[5, 2] = 1.0
    q[0] = p[0] * dt_s
    q[1] = p[1] * dt_s
    q[2] = p[2] * dt_s


@kernel
def derive(x: Vector, p: Vector, y: Vector) -> None:
    """Velocity in the plane."""
    y[0] = x[3] * math.cos(x[2])
    y[1] = x[3] * math.sin(x[2])
