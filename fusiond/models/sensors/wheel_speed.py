"""Speed along the heading, times the wheel's scale: z = scale * speed + v."""

from __future__ import annotations

from fusiond.models.contract import Process, Sensor
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector


def describe(process: Process, *, scale: float = 1.0) -> Sensor:
    """Describe the sensor.

    Args:
        scale: reading over true speed, from the wheel's radius.
    """
    return Sensor(channels=(process.slot("speed"),), reads=("speed",), parameters=(scale,))


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """h = scale * speed."""
    h[0] = p[0] * x[at[0]]
    H[0, at[0]] = p[0]
    return True
