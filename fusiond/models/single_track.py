"""The linear-tyre single-track model, for sideslip: lateral velocity and yaw rate, driven by steering and speed.

    F_f = C_f (d - (vy + lf yaw_rate) / v),    F_r = -C_r (vy - lr yaw_rate) / v
    vy' = ay - v yaw_rate,   ay = (F_f + F_r) / m,   yaw_rate' = (lf F_f - lr F_r) / Iz

Source: Rajamani 2012, section 2.3, small angles. Below `lowest_speed_m_s` the slip angles are taken at that speed.
`ay`, averaged over the interval that ended, is a slot, as in `ground_vehicle` and for the same reason: it depends on
the inputs.
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
    max_step_s: float = 0.02,
) -> Process:
    """Describe the model.

    Args:
        mass_kg, yaw_inertia_kg_m2: m and Iz.   front_m, rear_m: lf, lr, from the centre of gravity to the axles.
        stiffness_front_n_rad, stiffness_rear_n_rad: C_f, C_r, lateral force of an axle per rad of slip.
        specific_force_noise_m_s2_sqrt_hz: white lateral specific force that the tyres do not explain; an
            accelerometer measures it.   yaw_acceleration_noise_rad_s2_sqrt_hz: the same about the vertical.
        lowest_speed_m_s: slip angles are undefined at standstill.
        max_step_s: longest interval of one step; an accelerometer should be read at least as often.
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
    """Midpoint rule, second order in dt: x + dt (A (x + dt/2 (A x + b)) + b), b the part that steering drives.

    With e = A x + b, F = I + dt A + dt^2/2 A^2 and, for each input, B = dt (e_u + dt/2 A e_u + dt/2 A_u e).
    """
    m, inertia, lf, lr, front, rear = p[0], p[1], p[2], p[3], p[4], p[5]
    speed = max(u[1], p[8])
    c, s, w = front + rear, lf * front - lr * rear, lf * lf * front + lr * lr * rear
    # A = [[vy_vy, vy_r], [r_vy, r_r]]; the specific force is vy' without the turning of the frame
    vy_vy, force_r = -c / (m * speed), -s / (m * speed)
    vy_r = force_r - u[1]
    r_vy, r_r = -s / (inertia * speed), -w / (inertia * speed)
    push, turn = front / m, lf * front / inertia
    half = 0.5 * dt_s
    e0 = vy_vy * x[0] + vy_r * x[1] + push * u[0]
    e1 = r_vy * x[0] + r_r * x[1] + turn * u[0]
    middle_vy, middle_r = x[0] + half * e0, x[1] + half * e1
    ay = vy_vy * middle_vy + force_r * middle_r + push * u[0]
    x_next[0] = x[0] + dt_s * (ay - u[1] * middle_r)
    x_next[1] = x[1] + dt_s * (r_vy * middle_vy + r_r * middle_r + turn * u[0])
    x_next[2] = ay
    # how the middle depends on the start, then what follows from the middle
    a, b = 1.0 + half * vy_vy, half * vy_r
    d, e = half * r_vy, 1.0 + half * r_r
    F[2, 0] = vy_vy * a + force_r * d
    F[2, 1] = vy_vy * b + force_r * e
    F[0, 0] = 1.0 + dt_s * (F[2, 0] - u[1] * d)
    F[0, 1] = dt_s * (F[2, 1] - u[1] * e)
    F[1, 0] = dt_s * (r_vy * a + r_r * d)
    F[1, 1] = 1.0 + dt_s * (r_vy * b + r_r * e)
    B[2, 0] = vy_vy * half * push + force_r * half * turn + push
    B[0, 0] = dt_s * (B[2, 0] - u[1] * half * turn)
    B[1, 0] = dt_s * (r_vy * half * push + r_r * half * turn + turn)
    slower = -1.0 / speed if u[1] > p[8] else 0.0
    by_vy = half * (slower * (vy_vy * x[0] + force_r * x[1]) - x[1])
    by_r = half * slower * (r_vy * x[0] + r_r * x[1])
    B[2, 1] = vy_vy * by_vy + force_r * by_r + slower * (vy_vy * middle_vy + force_r * middle_r)
    B[0, 1] = dt_s * (B[2, 1] - u[1] * by_r - middle_r)
    B[1, 1] = dt_s * (r_vy * by_vy + r_r * by_r + slower * (r_vy * middle_vy + r_r * middle_r))


@kernel
def noise(x: Vector, dt_s: float, p: Vector, G: Matrix, q: Vector) -> None:
    """What the tyres do not explain moves the body and is felt by the accelerometer, as one."""
    G[0, 0] = dt_s
    G[2, 0] = 1.0
    q[0] = p[6] / dt_s
    G[1, 1] = 1.0
    q[1] = p[7] * dt_s
