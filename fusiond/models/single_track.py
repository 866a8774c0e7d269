"""The linear-tyre single-track model, for sideslip: lateral velocity and yaw rate, driven by steering and speed.

    F_f = C_f (d - (vy + lf yaw_rate) / v),    F_r = -C_r (vy - lr yaw_rate) / v
    vy' = ay - v yaw_rate,   ay = (F_f + F_r) / m,   yaw_rate' = (lf F_f - lr F_r) / Iz

Source: Rajamani 2012, section 2.3, small angles. Below `lowest_speed_m_s` the slip angles are taken at that speed.
`ay` of the interval that ended is a slot, as in `ground_vehicle` and for the same reason: it depends on the inputs.
"""

from __future__ import annotations

from fusiond.models.contract import Process
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot


def describe(
    *,
    mass_kg: float,
    yaw_inertia_kg_m2: float,
    front_m: float,
    rear_m: float,
    stiffness_front_n_rad: float,
    stiffness_rear_n_rad: float,
    specific_force_noise_m_s2_sqrt_hz: float,
    yaw_acceleration_noise_rad_s2_sqrt_hz: float,
    lowest_speed_m_s: float = 1.0,
    max_step_s: float = 0.001,
) -> Process:
    """Describe the model.

    Args:
        mass_kg, yaw_inertia_kg_m2: m and Iz.   front_m, rear_m: lf, lr, from the centre of gravity to the axles.
        stiffness_front_n_rad, stiffness_rear_n_rad: C_f, C_r, lateral force of an axle per rad of slip.
        specific_force_noise_m_s2_sqrt_hz: white lateral specific force that the tyres do not explain; an
            accelerometer measures it.   yaw_acceleration_noise_rad_s2_sqrt_hz: the same about the vertical.
        lowest_speed_m_s: slip angles are undefined at standstill.
        max_step_s: the Euler step; a longer interval is split.
    """
    return Process(
        states=(Slot("vy", "m_s"), Slot("yaw_rate", "rad_s"), Slot("ay", "m_s2")),
        inputs=(Slot("steering", "rad"), Slot("speed", "m_s")),
        noises=2,
        parameters=(
            mass_kg,
            yaw_inertia_kg_m2,
            front_m,
            rear_m,
            stiffness_front_n_rad,
            stiffness_rear_n_rad,
            specific_force_noise_m_s2_sqrt_hz**2,
            yaw_acceleration_noise_rad_s2_sqrt_hz**2,
            lowest_speed_m_s,
        ),
        max_step_s=max_step_s,
    )


@kernel
def transition(x: Vector, u: Vector, dt_s: float, p: Vector, x_next: Vector, F: Matrix, B: Matrix) -> None:
    """One Euler step."""
    m, inertia, lf, lr, front, rear = p[0], p[1], p[2], p[3], p[4], p[5]
    speed = max(u[1], p[8])
    slip_front = (x[0] + lf * x[1]) / speed
    slip_rear = (x[0] - lr * x[1]) / speed
    force_front = front * (u[0] - slip_front)
    force_rear = -rear * slip_rear
    ay = (force_front + force_rear) / m
    x_next[0] = x[0] + dt_s * (ay - u[1] * x[1])
    x_next[1] = x[1] + dt_s * (lf * force_front - lr * force_rear) / inertia
    x_next[2] = ay
    F[2, 0] = -(front + rear) / (m * speed)
    F[2, 1] = -(lf * front - lr * rear) / (m * speed)
    F[0, 0] = 1.0 + dt_s * F[2, 0]
    F[0, 1] = dt_s * (F[2, 1] - u[1])
    F[1, 0] = -dt_s * (lf * front - lr * rear) / (inertia * speed)
    F[1, 1] = 1.0 - dt_s * (lf * lf * front + lr * lr * rear) / (inertia * speed)
    B[2, 0] = front / m
    B[0, 0] = dt_s * B[2, 0]
    B[1, 0] = dt_s * lf * front / inertia
    B[0, 1] = -dt_s * x[1]
    if u[1] > p[8]:
        B[2, 1] = (front * slip_front + rear * slip_rear) / (m * speed)
        B[0, 1] += dt_s * B[2, 1]
        B[1, 1] = dt_s * (lf * front * slip_front - lr * rear * slip_rear) / (inertia * speed)


@kernel
def noise(x: Vector, dt_s: float, p: Vector, G: Matrix, q: Vector) -> None:
    """What the tyres do not explain moves the body and is felt by the accelerometer, as one."""
    G[0, 0] = dt_s
    G[2, 0] = 1.0
    q[0] = p[6] / dt_s
    G[1, 1] = 1.0
    q[1] = p[7] * dt_s
