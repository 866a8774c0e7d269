"""A body in the plane that may also move sideways: pose, velocity along and across its heading, and yaw rate.

    x' = forward_speed cos(yaw) - left_speed sin(yaw)
    y' = forward_speed sin(yaw) + left_speed cos(yaw)
    yaw' = yaw_rate;   forward_speed', left_speed', yaw_rate' = white

For odometry that gives a velocity in the body's frame (a ROS twist). Angles are counter-clockwise from the x axis.
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
    max_step_s: float = 0.1,
) -> Process:
    """Describe the model.

    Args:
        acceleration_noise_m_s2_sqrt_hz: white acceleration, the same along and across the heading.
        yaw_acceleration_noise_rad_s2_sqrt_hz: white yaw acceleration.
        max_step_s: longest interval of one prediction.
    """
    return Process(
        states=(
            Slot("x", "m"),
            Slot("y", "m"),
            Slot("yaw", "rad"),
            Slot("forward_speed", "m_s"),
            Slot("left_speed", "m_s"),
            Slot("yaw_rate", "rad_s"),
        ),
        noises=3,
        parameters=(acceleration_noise_m_s2_sqrt_hz**2, yaw_acceleration_noise_rad_s2_sqrt_hz**2),
        angles=("yaw",),
        outputs=(Slot("vx", "m_s"), Slot("vy", "m_s")),
        max_step_s=max_step_s,
    )


@kernel
def transition(x: Vector, u: Vector, dt_s: float, p: Vector, x_next: Vector, F: Matrix, B: Matrix) -> None:
    """Move at constant velocity in the body's frame, turned by the heading at mid-interval: second order in dt."""
    middle = x[2] + 0.5 * x[5] * dt_s
    cosine, sine = math.cos(middle), math.sin(middle)
    vx = x[3] * cosine - x[4] * sine
    vy = x[3] * sine + x[4] * cosine
    x_next[0] = x[0] + dt_s * vx
    x_next[1] = x[1] + dt_s * vy
    x_next[2] = wrap_angle(x[2] + x[5] * dt_s)
    x_next[3] = x[3]
    x_next[4] = x[4]
    x_next[5] = x[5]
    for i in range(6):
        F[i, i] = 1.0
    F[0, 2] = -dt_s * vy
    F[1, 2] = dt_s * vx
    F[0, 3] = dt_s * cosine
    F[1, 3] = dt_s * sine
    F[0, 4] = -dt_s * sine
    F[1, 4] = dt_s * cosine
    F[0, 5] = -0.5 * dt_s * dt_s * vy
    F[1, 5] = 0.5 * dt_s * dt_s * vx
    F[2, 5] = dt_s


@kernel
def noise(x: Vector, dt_s: float, p: Vector, G: Matrix, q: Vector) -> None:
    """Accelerations integrated over the interval: held, with the variance that white noise gives the speeds."""
    half = 0.5 * dt_s
    cosine, sine = math.cos(x[2]), math.sin(x[2])
    G[0, 0] = half * cosine
    G[1, 0] = half * sine
    G[3, 0] = 1.0
    G[0, 1] = -half * sine
    G[1, 1] = half * cosine
    G[4, 1] = 1.0
    G[2, 2] = half
    G[5, 2] = 1.0
    q[0] = p[0] * dt_s
    q[1] = p[0] * dt_s
    q[2] = p[1] * dt_s


@kernel
def derive(x: Vector, p: Vector, y: Vector) -> None:
    """Velocity in the plane."""
    cosine, sine = math.cos(x[2]), math.sin(x[2])
    y[0] = x[3] * cosine - x[4] * sine
    y[1] = x[3] * sine + x[4] * cosine
