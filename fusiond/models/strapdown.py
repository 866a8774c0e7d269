"""Strapdown inertial navigation: position, velocity, attitude and the biases of the IMU that drives it.

    p' = v,   v' = R(q) (f - accel_bias) + g,   q' = q (x) (w - gyro_bias) / 2,   biases: random walks

f, w: specific force and angular rate of the IMU, turned into the axes of the body by its mounting. x, y, z are the
IMU's position in a local frame that stands still: east, north, up (ENU) or north, east, down (NED); R(q) turns the body
into it. The earth's own turning, 15 deg/h, is left to the gyro's bias; g does not change with height.

The error state is (position, velocity, biases, attitude): q = exp(theta) (x) q_estimated, theta in rad about the axes
of the local frame (the global error of Sola 2017, section 7), so that attitude_z is the error of the heading, and the
transition from attitude to attitude is the identity. rate_x, rate_y, rate_z are the angular rate as last measured, the
bias still in it: what sensors off the IMU and at standstill need; they have no error of their own.

A reading in the axes of the body (wheels, the rate) does not say where north is: position and velocity turn with the
attitude it corrects, and their errors with them, so that turning the world stays exactly as unobservable as it is. That
is the right-invariant error of Barrau & Bonnabel 2017 (IEEE TAC 62), written as a reset of this one. A reading in the
axes of the world (GNSS) holds position and velocity where it sees them.
"""

from __future__ import annotations

import math
from typing import Literal

from fusiond.models.contract import Process, Turning
from fusiond.models.rigid import mounting
from fusiond.numerics.kernel import kernel
from fusiond.numerics.quaternion import (
    Rotation,
    Triple,
    cross,
    half_versine,
    pitch_of,
    roll_of,
    rotation_from,
    rotation_of,
    sine_rest,
    turn_between,
    turn_in_body,
    turn_in_world,
    turned,
    unit,
    yaw_of,
)
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot

V, GYRO, ACCEL, ATTITUDE, RATE = 3, 6, 9, 12, 16
"""Places in the state; in the error, those up to ATTITUDE are the same."""
MOUNTING = 3
"""Place of the mounting's nine numbers among the parameters: gravity_z, two variances, then these."""


def _slots(stem: str, unit: str) -> tuple[Slot, ...]:
    """Three slots, one an axis."""
    return tuple(Slot(f"{stem}{axis}", unit) for axis in "xyz")


def describe(
    *,
    frame: Literal["enu", "ned"],
    gyro_bias_noise_rad_s_sqrt_s: float,
    accel_bias_noise_m_s2_sqrt_s: float,
    imu_mounting_rad: list[float] | None = None,
    gravity_m_s2: float = 9.80665,
    max_step_s: float = 0.05,
) -> Process:
    """Describe the model.

    Args:
        frame: x, y, z are east, north, up or north, east, down; gravity points accordingly.
        gyro_bias_noise_rad_s_sqrt_s, accel_bias_noise_m_s2_sqrt_s: random walks of the biases.
        imu_mounting_rad: [roll, pitch, yaw] of the IMU's axes seen from the body's; level by default.
        gravity_m_s2: at the place.   max_step_s: longest interval of one prediction.
    """
    return Process(
        states=(
            *_slots("", "m"),
            *_slots("v", "m_s"),
            *_slots("gyro_bias_", "rad_s"),
            *_slots("accel_bias_", "m_s2"),
            *(Slot(f"q{part}") for part in "wxyz"),
            *_slots("rate_", "rad_s"),
        ),
        errors=(
            *_slots("", "m"),
            *_slots("v", "m_s"),
            *_slots("gyro_bias_", "rad_s"),
            *_slots("accel_bias_", "m_s2"),
            *_slots("attitude_", "rad"),
        ),
        origin=(*[0.0] * ATTITUDE, 1.0, *[0.0] * 6),
        inputs=(*_slots("angular_rate_", "rad_s"), *_slots("specific_force_", "m_s2")),
        noises=6,
        parameters=(
            -gravity_m_s2 if frame == "enu" else gravity_m_s2,
            gyro_bias_noise_rad_s_sqrt_s**2,
            accel_bias_noise_m_s2_sqrt_s**2,
            *mounting(imu_mounting_rad, "imu_mounting_rad"),
        ),
        outputs=(Slot("roll", "rad"), Slot("pitch", "rad"), Slot("yaw", "rad")),
        max_step_s=max_step_s,
        turning=Turning(
            heading="attitude_z",
            pairs=(("x", "y"), ("vx", "vy")),
            guarded=("gyro_bias_x", "gyro_bias_y", "gyro_bias_z", "attitude_z"),
            follows=True,
        ),
    )


@kernel
def transition(x: Vector, u: Vector, dt_s: float, p: Vector, x_next: Vector, F: Matrix, B: Matrix) -> None:
    """Turn with the rate held, accelerate with the attitude of mid-interval. F and B are exact for just this."""
    M = rotation_from(p, MOUNTING)
    rate = turned(M, u[0], u[1], u[2])
    force = turned(M, u[3], u[4], u[5])
    phi = (
        (rate[0] - x[GYRO]) * dt_s,
        (rate[1] - x[GYRO + 1]) * dt_s,
        (rate[2] - x[GYRO + 2]) * dt_s,
    )
    turn_in_body(x, ATTITUDE, 0.5 * phi[0], 0.5 * phi[1], 0.5 * phi[2], x_next, ATTITUDE)
    C = rotation_of(x_next, ATTITUDE)
    turn_in_body(x, ATTITUDE, phi[0], phi[1], phi[2], x_next, ATTITUDE)
    pushed = turned(C, force[0] - x[ACCEL], force[1] - x[ACCEL + 1], force[2] - x[ACCEL + 2])
    for i in range(3):
        gained = (pushed[i] + (p[0] if i == 2 else 0.0)) * dt_s
        x_next[i] = x[i] + (x[V + i] + 0.5 * gained) * dt_s
        x_next[V + i] = x[V + i] + gained
        x_next[GYRO + i] = x[GYRO + i]
        x_next[ACCEL + i] = x[ACCEL + i]
        x_next[RATE + i] = rate[i]
    _error_transition(C, pushed, phi, dt_s, F)
    _input_effect(M, F, B)


@kernel
def _error_transition(C: Rotation, pushed: Triple, phi: Triple, dt_s: float, F: Matrix) -> None:
    """The transition of the error.

    A small turn theta at the start turns the force by as much: v moves by theta x pushed dt. A small rate moves the
    attitude of the end by R(q) J_l(phi) dt = C (I + k [phi]x^2) dt, k = (1 - sinc(|phi| / 2)) / |phi|^2, and that of
    mid-interval by C J_r(phi / 2) dt / 2, J_r(phi / 2) = I + m [phi]x + k [phi]x^2. J_l, J_r: left and right
    Jacobians of SO(3), Sola 2017, section 4.3; C is the attitude of mid-interval, R(q) that of the start.
    """
    half = 0.5 * math.sqrt(phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
    # k by 1 - sinc(h) = h^2 sine_rest(h), h = |phi| / 2
    m, k = -0.5 * half_versine(half), 0.25 * sine_rest(half)
    for i in range(ATTITUDE + 3):
        F[i, i] = 1.0
    for j in range(3):
        F[j, V + j] = dt_s
        e = unit(j)
        once = cross(phi, e)
        twice = cross(phi, once)
        kept = (e[0] + k * twice[0], e[1] + k * twice[1], e[2] + k * twice[2])
        end = turned(C, kept[0], kept[1], kept[2])
        middle = turned(C, kept[0] + m * once[0], kept[1] + m * once[1], kept[2] + m * once[2])
        by_turn = cross(e, pushed)
        by_rate = cross(middle, pushed)
        for i in range(3):
            F[ATTITUDE + i, GYRO + j] = -dt_s * end[i]
            F[V + i, GYRO + j] = -0.5 * dt_s * dt_s * by_rate[i]
            F[V + i, ACCEL + j] = -dt_s * C[i][j]
            F[V + i, ATTITUDE + j] = dt_s * by_turn[i]
    for i in range(3):
        for j in range(GYRO, ATTITUDE + 3):
            F[i, j] = 0.5 * dt_s * F[V + i, j]


@kernel
def _input_effect(M: Rotation, F: Matrix, B: Matrix) -> None:
    """A reading moves the error as a bias does, the other way round, through the mounting."""
    for j in range(3):
        for i in range(V + 3):
            for k in range(3):
                B[i, j] -= F[i, GYRO + k] * M[k][j]
                B[i, 3 + j] -= F[i, ACCEL + k] * M[k][j]
        for i in range(ATTITUDE, ATTITUDE + 3):
            for k in range(3):
                B[i, j] -= F[i, GYRO + k] * M[k][j]


@kernel
def noise(x: Vector, dt_s: float, p: Vector, G: Matrix, q: Vector) -> None:
    """The biases walk; what the walk adds to attitude and velocity within one interval is left out (order dt^3)."""
    for i in range(3):
        G[GYRO + i, i] = 1.0
        G[ACCEL + i, 3 + i] = 1.0
        q[i] = p[1] * dt_s
        q[3 + i] = p[2] * dt_s


@kernel
def add_error(x: Vector, dx: Vector, p: Vector) -> None:
    """Add position, velocity and biases; turn about the axes of the local frame."""
    for i in range(ATTITUDE):
        x[i] += dx[i]
    turn_in_world(x, ATTITUDE, dx[ATTITUDE], dx[ATTITUDE + 1], dx[ATTITUDE + 2])


@kernel
def turn_error(x: Vector, dx: Vector, p: Vector, J: Matrix) -> None:
    """Position and velocity move by V(theta) dx, V = J_l the left Jacobian of SO(3): the exponential of SE_2(3).

    J: their errors, less theta x (position, velocity), are those of before: block -[V dx]x from attitude to each.
    """
    theta = (dx[ATTITUDE], dx[ATTITUDE + 1], dx[ATTITUDE + 2])
    angle = math.sqrt(theta[0] * theta[0] + theta[1] * theta[1] + theta[2] * theta[2])
    first, second = half_versine(angle), sine_rest(angle)
    for at in range(0, V + 3, 3):
        step = (dx[at], dx[at + 1], dx[at + 2])
        once = cross(theta, step)
        twice = cross(theta, once)
        moved = (
            step[0] + first * once[0] + second * twice[0],
            step[1] + first * once[1] + second * twice[1],
            step[2] + first * once[2] + second * twice[2],
        )
        for i in range(3):
            x[at + i] += moved[i]
            turned_error = cross(unit(i), moved)
            for k in range(3):
                J[at + k, ATTITUDE + i] = turned_error[k]
    for i in range(V + 3, ATTITUDE):
        x[i] += dx[i]
    turn_in_world(x, ATTITUDE, theta[0], theta[1], theta[2])


@kernel
def error_between(x: Vector, y: Vector, p: Vector, dx: Vector) -> None:
    """Differences, and the turn that leads from one attitude to the other."""
    for i in range(ATTITUDE):
        dx[i] = y[i] - x[i]
    turn_between(x, y, ATTITUDE, dx, ATTITUDE)


@kernel
def derive(x: Vector, p: Vector, y: Vector) -> None:
    """Roll, pitch and yaw (z-y-x) of the body in the local frame."""
    R = rotation_of(x, ATTITUDE)
    y[0] = roll_of(R)
    y[1] = pitch_of(R)
    y[2] = yaw_of(R)
