"""A heading, counter-clockwise from the x axis, rad: z = yaw + offset + v, compared on the circle."""

from __future__ import annotations

from fusiond.models.contract import Process, Sensor
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector


def describe(process: Process, *, offset_rad: float = 0.0) -> Sensor:
    """Describe the sensor.

    Args:
        offset_rad: its mounting: reading minus heading.
    """
    return Sensor(channels=(process.slot("yaw"),), reads=("yaw",), wraps=("yaw",), parameters=(offset_rad,))


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """h = yaw + offset."""
    h[0] = x[at[0]] + p[0]
    H[0, at[0]] = 1.0
    return True
