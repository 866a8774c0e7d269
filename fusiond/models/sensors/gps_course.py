"""A GPS receiver's own numbers: speed over ground, course, position.

    z = [ |v|, yaw + atan2(vy, vx), x, y ] + v,   course counter-clockwise from the x axis, compared on the circle

Source: seed 002, equations 7 to 9, from the three numbers {speed, course, heading} that are measured, with R of their
own. The seed turns them into vx, vy and sideslip first and keeps the heading beside them: four channels of three
numbers, whose covariance is singular. Its (7) has sideslip = psi - course, which holds for compass bearings only; by
(8) and (9) it is course - psi.
"""

from __future__ import annotations

import math

from fusiond.models.contract import Process, Sensor
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot


def describe(process: Process) -> Sensor:
    """Describe the sensor: it attaches to body velocities vx, vy with a yaw, and a position x, y."""
    return Sensor(
        channels=(Slot("speed", "m_s"), Slot("course", "rad"), process.slot("x"), process.slot("y")),
        reads=("vx", "vy", "yaw", "x", "y"),
        wraps=("course",),
    )


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """Polar velocity in the ground frame; at standstill speed and course say nothing, their rows stay zero."""
    vx, vy = x[at[0]], x[at[1]]
    square = vx * vx + vy * vy
    speed = math.sqrt(square)
    h[0] = speed
    h[1] = x[at[2]] + math.atan2(vy, vx)
    h[2] = x[at[3]]
    h[3] = x[at[4]]
    H[2, at[3]] = 1.0
    H[3, at[4]] = 1.0
    if square > 0.0:
        H[0, at[0]] = vx / speed
        H[0, at[1]] = vy / speed
        H[1, at[0]] = -vy / square
        H[1, at[1]] = vx / square
        H[1, at[2]] = 1.0
    return True
