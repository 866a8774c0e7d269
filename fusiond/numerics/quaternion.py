"""Attitude as a unit quaternion q = (w, x, y, z) that turns vectors of the body into the world: v_W = R(q) v_B.

Hamilton's product, right-handed (Sola 2017, arXiv:1711.02508, sections 1 to 4). Written in loops and scalars: numba
compiles array expressions slowly. `at` is the place of w in a longer vector.
"""

from __future__ import annotations

import math

from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Vector

Triple = tuple[float, float, float]
Rotation = tuple[Triple, Triple, Triple]

SMALL_RAD = 1e-2
"""Below this half angle, series: their first term left out is below 1e-16 of the result."""


@kernel
def sinc(angle_rad: float) -> float:
    """sin(a) / a."""
    if abs(angle_rad) < SMALL_RAD:
        square = angle_rad * angle_rad
        return 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0))
    return math.sin(angle_rad) / angle_rad


@kernel
def half_versine(angle_rad: float) -> float:
    """(1 - cos a) / a^2."""
    half = sinc(0.5 * angle_rad)
    return 0.5 * half * half


@kernel
def sine_rest(angle_rad: float) -> float:
    """(a - sin a) / a^3, a series up to half a radian: the difference would lose its digits."""
    if abs(angle_rad) < 0.5:
        square = angle_rad * angle_rad
        total, term = 0.0, 1.0 / 6.0
        for k in range(2, 9):
            total += term
            term *= -square / ((2 * k) * (2 * k + 1))
        return total
    return (angle_rad - math.sin(angle_rad)) / (angle_rad * angle_rad * angle_rad)


@kernel
def rotation_of(x: Vector, at: int) -> Rotation:
    """R(q) of the unit quaternion x[at:at + 4], as three rows; a tuple costs no memory."""
    w, a, b, c = x[at], x[at + 1], x[at + 2], x[at + 3]
    return (
        (1.0 - 2.0 * (b * b + c * c), 2.0 * (a * b - w * c), 2.0 * (a * c + w * b)),
        (2.0 * (a * b + w * c), 1.0 - 2.0 * (a * a + c * c), 2.0 * (b * c - w * a)),
        (2.0 * (a * c - w * b), 2.0 * (b * c + w * a), 1.0 - 2.0 * (a * a + b * b)),
    )


@kernel
def turned(R: Rotation, x: float, y: float, z: float) -> Triple:
    """R v."""
    return (
        R[0][0] * x + R[0][1] * y + R[0][2] * z,
        R[1][0] * x + R[1][1] * y + R[1][2] * z,
        R[2][0] * x + R[2][1] * y + R[2][2] * z,
    )


@kernel
def turned_back(R: Rotation, x: float, y: float, z: float) -> Triple:
    """R' v."""
    return (
        R[0][0] * x + R[1][0] * y + R[2][0] * z,
        R[0][1] * x + R[1][1] * y + R[2][1] * z,
        R[0][2] * x + R[1][2] * y + R[2][2] * z,
    )


@kernel
def rotation_from(p: Vector, at: int) -> Rotation:
    """The matrix that stands row by row in p[at:at + 9]."""
    return (
        (p[at], p[at + 1], p[at + 2]),
        (p[at + 3], p[at + 4], p[at + 5]),
        (p[at + 6], p[at + 7], p[at + 8]),
    )


@kernel
def cross(a: Triple, b: Triple) -> Triple:
    """a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@kernel
def unit(axis: int) -> Triple:
    """The unit vector of an axis."""
    return (1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)


@kernel
def turn_in_body(x: Vector, at: int, tx: float, ty: float, tz: float, out: Vector, to: int) -> None:
    """Write q (x) exp(theta) to out[to:], theta (rad) along the axes of the body; normalised. `out` may be x."""
    half = 0.5 * math.sqrt(tx * tx + ty * ty + tz * tz)
    e, s = math.cos(half), 0.5 * sinc(half)
    w, a, b, c = x[at], x[at + 1], x[at + 2], x[at + 3]
    i, j, k = s * tx, s * ty, s * tz
    _write_unit(
        w * e - a * i - b * j - c * k,
        w * i + a * e + b * k - c * j,
        w * j - a * k + b * e + c * i,
        w * k + a * j - b * i + c * e,
        out,
        to,
    )


@kernel
def turn_in_world(x: Vector, at: int, tx: float, ty: float, tz: float) -> None:
    """q <- exp(theta) (x) q in place, theta (rad) along the axes of the world; normalised."""
    half = 0.5 * math.sqrt(tx * tx + ty * ty + tz * tz)
    e, s = math.cos(half), 0.5 * sinc(half)
    w, a, b, c = x[at], x[at + 1], x[at + 2], x[at + 3]
    i, j, k = s * tx, s * ty, s * tz
    _write_unit(
        e * w - i * a - j * b - k * c,
        e * a + i * w + j * c - k * b,
        e * b - i * c + j * w + k * a,
        e * c + i * b - j * a + k * w,
        x,
        at,
    )


@kernel
def _write_unit(w: float, a: float, b: float, c: float, out: Vector, to: int) -> None:
    """Write the quaternion scaled to length one."""
    scale = 1.0 / math.sqrt(w * w + a * a + b * b + c * c)
    out[to] = w * scale
    out[to + 1] = a * scale
    out[to + 2] = b * scale
    out[to + 3] = c * scale


@kernel
def turn_between(x: Vector, y: Vector, at: int, out: Vector, to: int) -> None:
    """Write theta (rad, world axes, |theta| <= pi) to out[to:to + 3] with exp(theta) (x) q(x) = q(y)."""
    w, a, b, c = x[at], -x[at + 1], -x[at + 2], -x[at + 3]
    e, i, j, k = y[at], y[at + 1], y[at + 2], y[at + 3]
    tw = e * w - i * a - j * b - k * c
    tx = e * a + i * w + j * c - k * b
    ty = e * b - i * c + j * w + k * a
    tz = e * c + i * b - j * a + k * w
    sign = -1.0 if tw < 0.0 else 1.0
    sine = math.sqrt(tx * tx + ty * ty + tz * tz)
    half = math.atan2(sine, sign * tw)
    scale = 2.0 * sign / sinc(half)
    out[to] = scale * tx
    out[to + 1] = scale * ty
    out[to + 2] = scale * tz


@kernel
def roll_of(R: Rotation) -> float:
    """Rotation about the body's x axis, last of z-y-x angles, rad."""
    return math.atan2(R[2][1], R[2][2])


@kernel
def pitch_of(R: Rotation) -> float:
    """Rotation about the turned y axis, second of z-y-x angles, rad; within a quarter turn."""
    return math.atan2(-R[2][0], math.sqrt(R[2][1] * R[2][1] + R[2][2] * R[2][2]))


@kernel
def yaw_of(R: Rotation) -> float:
    """Rotation about the world's z axis, first of z-y-x angles, rad."""
    return math.atan2(R[1][0], R[0][0])


def from_angles(roll_rad: float, pitch_rad: float, yaw_rad: float) -> tuple[float, float, float, float]:
    """The quaternion of z-y-x angles: R = R_z(yaw) R_y(pitch) R_x(roll). Plain Python, for design time."""
    cr, sr = math.cos(0.5 * roll_rad), math.sin(0.5 * roll_rad)
    cp, sp = math.cos(0.5 * pitch_rad), math.sin(0.5 * pitch_rad)
    cy, sy = math.cos(0.5 * yaw_rad), math.sin(0.5 * yaw_rad)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
