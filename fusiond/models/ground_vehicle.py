"""A road vehicle in the plane, driven by its four wheel forces and its steering; nothing is assumed of its tyres.

    vx'       = ax + vy yaw_rate,    ax = ((F_LFL + F_LFR) cos d + F_LRL + F_LRR - F_SF sin d - drag) / m     (6a)
    vy'       = ay - vx yaw_rate,    ay = ((F_LFL + F_LFR) sin d + F_SR + F_SF cos d) / m                     (6b)
    yaw_rate' = (((F_LRR - F_LRL) + (F_LFR - F_LFL) cos d) ls / 2
                 + (F_SF cos d + (F_LFL + F_LFR) sin d) lf - F_SR lr) / Iz                                    (6c)
    force_front' = force_rear' = white noise (lateral axle forces F_SF, F_SR: "defined as unknown")
    yaw' = yaw_rate,   x' = vx cos yaw - vy sin yaw,   y' = vx sin yaw + vy cos yaw                           (9)
    drag = air_density drag_area (vx^2 + vy^2) / 2, against forward travel                                    (5)

taken with the seed's Euler step (11). Source: seed 002, with two misprints resolved by its equation (3): cos d on F_SF
in (6b), + before (F_LFL + F_LFR) sin d in (2) and (6c). Frame: x ahead, y to the left, yaw counter-clockwise.

The seed's h(X, U) has the accelerations depend on the inputs, whose errors then enter prediction and reading alike.
Therefore the specific forces `ax`, `ay` of the interval that ended are slots too, behind the seed's eight: they are
what an accelerometer averages over the interval, their errors are tied to those of the velocities, and `direct` reads
them.
"""

from __future__ import annotations

import math

from fusiond.models.contract import Process
from fusiond.numerics.discretise import wrap_angle
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot

STATES = (
    Slot("vx", "m_s"), Slot("vy", "m_s"), Slot("yaw_rate", "rad_s"), Slot("force_front", "n"),
    Slot("force_rear", "n"), Slot("yaw", "rad"), Slot("x", "m"), Slot("y", "m"), Slot("ax", "m_s2"), Slot("ay", "m_s2"),
)  # fmt: skip
INPUTS = (
    Slot("drive_front_left", "n"), Slot("drive_front_right", "n"), Slot("drive_rear_left", "n"),
    Slot("drive_rear_right", "n"), Slot("steering", "rad"),
)  # fmt: skip


def describe(
    *,
    mass_kg: float,
    yaw_inertia_kg_m2: float,
    front_m: float,
    rear_m: float,
    track_m: float,
    force_noise_n_sqrt_s: float,
    specific_force_noise_m_s2_sqrt_hz: float = 0.0,
    yaw_acceleration_noise_rad_s2_sqrt_hz: float = 0.0,
    drag_area_m2: float = 0.0,
    air_density_kg_m3: float = 1.225,
    max_step_s: float = 0.001,
) -> Process:
    """Describe the model.

    Args:
        mass_kg, yaw_inertia_kg_m2: m and Iz.
        front_m, rear_m: lf, lr, from the centre of gravity to the axles.   track_m: ls, between the wheels of an axle.
        force_noise_n_sqrt_s: random walk of each lateral axle force.
        specific_force_noise_m_s2_sqrt_hz: white specific force along and across that no modelled force explains; an
            accelerometer measures it.   yaw_acceleration_noise_rad_s2_sqrt_hz: the same about the vertical.
        drag_area_m2: drag factor times frontal area.   air_density_kg_m3: of the air.
        max_step_s: the Euler step; a longer interval is split.
    """
    return Process(
        states=STATES,
        inputs=INPUTS,
        noises=5,
        parameters=(
            mass_kg,
            yaw_inertia_kg_m2,
            front_m,
            rear_m,
            0.5 * track_m,
            0.5 * air_density_kg_m3 * drag_area_m2,
            force_noise_n_sqrt_s**2,
            specific_force_noise_m_s2_sqrt_hz**2,
            yaw_acceleration_noise_rad_s2_sqrt_hz**2,
        ),
        angles=("yaw",),
        outputs=(Slot("speed", "m_s"), Slot("sideslip", "rad")),
        max_step_s=max_step_s,
    )


@kernel
def transition(x: Vector, u: Vector, dt_s: float, p: Vector, x_next: Vector, F: Matrix, B: Matrix) -> None:
    """One Euler step (11) of (6) and (9)."""
    m, inertia, lf, lr, half_track, drag = p[0], p[1], p[2], p[3], p[4], p[5]
    vx, vy, rate = x[0], x[1], x[2]
    cosine, sine = math.cos(u[4]), math.sin(u[4])
    front = u[0] + u[1]
    across = u[1] - u[0]
    ax = (front * cosine + u[2] + u[3] - x[3] * sine - drag * (vx * vx + vy * vy)) / m
    ay = (front * sine + x[4] + x[3] * cosine) / m
    turning = (u[3] - u[2] + across * cosine) * half_track + (x[3] * cosine + front * sine) * lf - x[4] * lr
    ahead_x, ahead_y = math.cos(x[5]), math.sin(x[5])
    x_next[0] = vx + dt_s * (ax + vy * rate)
    x_next[1] = vy + dt_s * (ay - vx * rate)
    x_next[2] = rate + dt_s * turning / inertia
    x_next[3] = x[3]
    x_next[4] = x[4]
    x_next[5] = wrap_angle(x[5] + dt_s * rate)
    x_next[6] = x[6] + dt_s * (vx * ahead_x - vy * ahead_y)
    x_next[7] = x[7] + dt_s * (vx * ahead_y + vy * ahead_x)
    x_next[8] = ax
    x_next[9] = ay
    for i in range(8):
        F[i, i] = 1.0
    F[8, 0] = -2.0 * drag * vx / m
    F[8, 1] = -2.0 * drag * vy / m
    F[8, 3] = -sine / m
    F[9, 3] = cosine / m
    F[9, 4] = 1.0 / m
    F[0, 0] += dt_s * F[8, 0]
    F[0, 1] = dt_s * (F[8, 1] + rate)
    F[0, 2] = dt_s * vy
    F[0, 3] = dt_s * F[8, 3]
    F[1, 0] = -dt_s * rate
    F[1, 2] = -dt_s * vx
    F[1, 3] = dt_s * F[9, 3]
    F[1, 4] = dt_s * F[9, 4]
    F[2, 3] = dt_s * cosine * lf / inertia
    F[2, 4] = -dt_s * lr / inertia
    F[5, 2] = dt_s
    F[6, 0] = dt_s * ahead_x
    F[6, 1] = -dt_s * ahead_y
    F[6, 5] = -dt_s * (vx * ahead_y + vy * ahead_x)
    F[7, 0] = dt_s * ahead_y
    F[7, 1] = dt_s * ahead_x
    F[7, 5] = dt_s * (vx * ahead_x - vy * ahead_y)
    B[8, 0] = B[8, 1] = cosine / m
    B[8, 2] = B[8, 3] = 1.0 / m
    B[8, 4] = -(front * sine + x[3] * cosine) / m
    B[9, 0] = B[9, 1] = sine / m
    B[9, 4] = (front * cosine - x[3] * sine) / m
    B[2, 0] = (-cosine * half_track + sine * lf) * dt_s / inertia
    B[2, 1] = (cosine * half_track + sine * lf) * dt_s / inertia
    B[2, 2] = -half_track * dt_s / inertia
    B[2, 3] = half_track * dt_s / inertia
    B[2, 4] = (-across * sine * half_track + (front * cosine - x[3] * sine) * lf) * dt_s / inertia
    for j in range(5):
        B[0, j] = dt_s * B[8, j]
        B[1, j] = dt_s * B[9, j]


@kernel
def noise(x: Vector, dt_s: float, p: Vector, G: Matrix, q: Vector) -> None:
    """Axle forces wander; what no force explains moves the velocity and is felt by the accelerometer, as one."""
    G[3, 0] = 1.0
    G[4, 1] = 1.0
    q[0] = q[1] = p[6] * dt_s
    G[0, 2] = dt_s
    G[8, 2] = 1.0
    G[1, 3] = dt_s
    G[9, 3] = 1.0
    q[2] = q[3] = p[7] / dt_s
    G[2, 4] = 1.0
    q[4] = p[8] * dt_s


@kernel
def derive(x: Vector, p: Vector, y: Vector) -> None:
    """Speed over ground, and sideslip: course minus yaw."""
    y[0] = math.sqrt(x[0] * x[0] + x[1] * x[1])
    y[1] = math.atan2(x[1], x[0])
