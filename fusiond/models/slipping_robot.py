"""A robot on two driven wheels that slip, driven by its measured acceleration: an indirect (error-state) filter.

    x' = speed cos(yaw), y' = speed sin(yaw),   yaw' = body_rate:
    body_rate = (1 - track_error - turn_slip) (wheel_turning - wheel_mismatch speed / track)
    speed' = acceleration - acceleration_bias      (the accelerometer drives; its noise comes with its readings)
    wheel_turning' = -wheel_turning / turning_time + white noise   (difference of the wheels' speeds over the track)
    push_slip' = -push_slip / push_slip_time + white noise     (wheels run ahead of the body by acceleration x this)
    turn_slip' = -turn_slip / turn_slip_time + white noise     (share of a turn of the wheels that scrubs)
    wheel_mismatch, track_error, acceleration_bias, gyro_bias: constants of a run

wheel_mismatch and track_error are the two systematic errors of odometry that a closed path does not forgive: unequal
wheels and uncertain track (E_d and E_b of Borenstein and Feng 1996, whom seed 003 cites). The size that both wheels
share makes a closed path larger, not open, and is no state.

The wheels' turning is a state, not the body's: so what encoders see of it does not depend on the errors that they
cannot see, and nothing is learned of those by linearising twice at different estimates. The slots are the nominal
trajectory, seed 003's x_Ref; F, G and H are of the error dx, which every update injects and resets (`add_error`). The
last slot, the acceleration as measured over the interval that ended, is a reading and has no error: encoders need it,
for wheels slip where they push or brake. Angles are counter-clockwise from the x axis, rad.
"""

from __future__ import annotations

import math

from fusiond.models.contract import Process
from fusiond.numerics.discretise import wrap_angle
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot

YAW, SPEED, TURNING, ACCELERATION_BIAS, PUSH_SLIP, MISMATCH, TRACK_ERROR, TURN_SLIP = 2, 3, 4, 5, 6, 7, 8, 9
"""Places in the state and in the error alike."""
TRACK = 6
"""Place of the track among the parameters."""
ERRORS = (
    Slot("x", "m"), Slot("y", "m"), Slot("yaw", "rad"), Slot("speed", "m_s"), Slot("wheel_turning", "rad_s"),
    Slot("acceleration_bias", "m_s2"), Slot("push_slip", "s"), Slot("wheel_mismatch"), Slot("track_error"),
    Slot("turn_slip"),
)  # fmt: skip


def describe(
    *,
    track_m: float,
    yaw_acceleration_noise_rad_s2_sqrt_hz: float,
    push_slip_std_s: float,
    turn_slip_std: float,
    turning_time_s: float = 0.5,
    push_slip_time_s: float = 0.5,
    turn_slip_time_s: float = 1.0,
    gyro: bool = False,
    max_step_s: float = 0.05,
) -> Process:
    """Describe the model.

    Args:
        track_m: between the wheels, as measured with a rule.
        yaw_acceleration_noise_rad_s2_sqrt_hz: white, of the wheels' turning.
        turning_time_s: how fast a turn is forgotten.
        push_slip_std_s: spread of the wheels' slip, m/s, for each m/s^2 that the robot accelerates or brakes.
        push_slip_time_s: how fast a slip is forgotten.
        turn_slip_std: spread of the share by which turns slip.   turn_slip_time_s: how fast a share is forgotten.
        gyro: there is one, and its bias is a state.
        max_step_s: longest interval of one prediction.
    """
    errors = (*ERRORS, Slot("gyro_bias", "rad_s")) if gyro else ERRORS
    return Process(
        states=(*errors, Slot("felt_acceleration", "m_s2")),
        errors=errors,
        inputs=(Slot("acceleration", "m_s2"),),
        noises=3,
        parameters=(
            yaw_acceleration_noise_rad_s2_sqrt_hz**2,
            push_slip_std_s**2,
            turn_slip_std**2,
            turning_time_s,
            push_slip_time_s,
            turn_slip_time_s,
            track_m,
        ),
        angles=("yaw",),
        outputs=(Slot("yaw_rate", "rad_s"), Slot("vx", "m_s"), Slot("vy", "m_s")),
        max_step_s=max_step_s,
    )


@kernel
def transition(x: Vector, u: Vector, dt_s: float, p: Vector, x_next: Vector, F: Matrix, B: Matrix) -> None:
    """Accelerate as measured, along the heading of mid-interval: second order in dt; F and B are exact for that."""
    n = F.shape[0]
    for i in range(n):
        x_next[i] = x[i]
        F[i, i] = 1.0
    acceleration = u[0] - x[ACCELERATION_BIAS]
    turn = _turn(x, dt_s, p, F)
    middle = x[YAW] + 0.5 * turn
    forward_x, forward_y = math.cos(middle), math.sin(middle)
    way = dt_s * (x[SPEED] + 0.5 * dt_s * acceleration)
    x_next[0] = x[0] + way * forward_x
    x_next[1] = x[1] + way * forward_y
    x_next[YAW] = wrap_angle(x[YAW] + turn)
    x_next[SPEED] = x[SPEED] + dt_s * acceleration
    x_next[n] = u[0]
    for i in (TURNING, PUSH_SLIP, TURN_SLIP):
        x_next[i] = F[i, i] * x[i]
    for j in range(SPEED, TURN_SLIP + 1):
        F[0, j] = -0.5 * way * forward_y * F[YAW, j]
        F[1, j] = 0.5 * way * forward_x * F[YAW, j]
    F[0, YAW] = -way * forward_y
    F[1, YAW] = way * forward_x
    F[0, SPEED] += dt_s * forward_x
    F[1, SPEED] += dt_s * forward_y
    F[SPEED, ACCELERATION_BIAS] = -dt_s
    B[SPEED, 0] = dt_s
    B[0, 0] = 0.5 * dt_s * dt_s * forward_x
    B[1, 0] = 0.5 * dt_s * dt_s * forward_y
    for i in range(2):
        F[i, ACCELERATION_BIAS] -= B[i, 0]


@kernel
def _turn(x: Vector, dt_s: float, p: Vector, F: Matrix) -> float:
    """What the body turns in an interval, rad; writes its row of F and how much is kept of what dies out."""
    F[TURNING, TURNING] = math.exp(-dt_s / p[3])
    F[PUSH_SLIP, PUSH_SLIP] = math.exp(-dt_s / p[4])
    F[TURN_SLIP, TURN_SLIP] = math.exp(-dt_s / p[5])
    by_wheels = p[3] * (1.0 - F[TURNING, TURNING])
    by_way = dt_s / p[TRACK]
    share = 1.0 - x[TRACK_ERROR] - x[TURN_SLIP]
    turn = by_wheels * x[TURNING] - by_way * x[MISMATCH] * x[SPEED]
    F[YAW, SPEED] = -share * by_way * x[MISMATCH]
    F[YAW, TURNING] = share * by_wheels
    F[YAW, MISMATCH] = -share * by_way * x[SPEED]
    F[YAW, TRACK_ERROR] = F[YAW, TURN_SLIP] = -turn
    return share * turn


@kernel
def body_rate(turning: float, speed: float, mismatch: float, share: float, track_m: float) -> float:
    """Yaw rate of the body: of the wheels' turning, corrected for unequal wheels, the share that is no scrubbing."""
    return share * (turning - mismatch * speed / track_m)


@kernel
def noise(x: Vector, dt_s: float, p: Vector, G: Matrix, q: Vector) -> None:
    """What keeps the wheels' turning and both slips from dying out."""
    G[YAW, 0] = 0.5 * dt_s
    G[TURNING, 0] = 1.0
    q[0] = p[0] * 0.5 * p[3] * (1.0 - math.exp(-2.0 * dt_s / p[3]))
    G[PUSH_SLIP, 1] = 1.0
    q[1] = p[1] * (1.0 - math.exp(-2.0 * dt_s / p[4]))
    G[TURN_SLIP, 2] = 1.0
    q[2] = p[2] * (1.0 - math.exp(-2.0 * dt_s / p[5]))


@kernel
def add_error(x: Vector, dx: Vector, p: Vector) -> None:
    """Inject an error into the nominal trajectory (3): plain sums, the heading kept on the circle."""
    for i in range(dx.shape[0]):
        x[i] += dx[i]
    x[YAW] = wrap_angle(x[YAW])


@kernel
def error_between(x: Vector, y: Vector, p: Vector, dx: Vector) -> None:
    """Differences, that of the headings the short way round."""
    for i in range(dx.shape[0]):
        dx[i] = y[i] - x[i]
    dx[YAW] = wrap_angle(dx[YAW])


@kernel
def derive(x: Vector, p: Vector, y: Vector) -> None:
    """Yaw rate of the body, and velocity in the plane."""
    share = 1.0 - x[TRACK_ERROR] - x[TURN_SLIP]
    y[0] = body_rate(x[TURNING], x[SPEED], x[MISMATCH], share, p[TRACK])
    y[1] = x[SPEED] * math.cos(x[YAW])
    y[2] = x[SPEED] * math.sin(x[YAW])
