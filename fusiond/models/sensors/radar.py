"""A radar at the origin, or at a given place: range, bearing and range rate of the tracked point.

Attaches to states x, y, vx, vy, or to x, y, yaw, speed (then v = speed (cos yaw, sin yaw)).
"""

from __future__ import annotations

import math

from fusiond.errors import ConfigError
from fusiond.models.contract import Process, Sensor
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot


def describe(process: Process, *, x_m: float = 0.0, y_m: float = 0.0) -> Sensor:
    """Describe the sensor.

    Args:
        x_m, y_m: where it stands.
    """
    polar = process.has("yaw", "speed")
    if not process.has("x", "y") or not (polar or process.has("vx", "vy")):
        raise ConfigError(
            "kind `radar` needs states x, y and either vx, vy or yaw, speed; choose another model"
        )
    return Sensor(
        channels=(Slot("range", "m"), Slot("bearing", "rad"), Slot("range_rate", "m_s")),
        reads=("x", "y", "yaw", "speed") if polar else ("x", "y", "vx", "vy"),
        wraps=("bearing",),
        parameters=(x_m, y_m, float(polar)),
    )


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """Polar coordinates; on top of the radar the bearing is unknown and its row stays zero."""
    east, north = x[at[0]] - p[0], x[at[1]] - p[1]
    vx, vy = x[at[2]], x[at[3]]
    if p[2] > 0.0:
        vx, vy = x[at[3]] * math.cos(x[at[2]]), x[at[3]] * math.sin(x[at[2]])
    square = east * east + north * north
    distance = math.sqrt(square)
    h[0] = distance
    h[1] = math.atan2(north, east)
    if distance == 0.0:
        return True
    unit_x, unit_y = east / distance, north / distance
    h[2] = unit_x * vx + unit_y * vy
    across = (unit_x * vy - unit_y * vx) / distance
    H[0, at[0]] = unit_x
    H[0, at[1]] = unit_y
    H[1, at[0]] = -north / square
    H[1, at[1]] = east / square
    H[2, at[0]] = -unit_y * across
    H[2, at[1]] = unit_x * across
    if p[2] > 0.0:
        H[2, at[2]] = -unit_x * vy + unit_y * vx
        H[2, at[3]] = unit_x * math.cos(x[at[2]]) + unit_y * math.sin(x[at[2]])
    else:
        H[2, at[2]] = unit_x
        H[2, at[3]] = unit_y
    return True
