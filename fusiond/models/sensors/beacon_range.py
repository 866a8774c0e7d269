"""Range to a beacon whose number is the reading's second value: z = [|p - beacon|, number]."""

from __future__ import annotations

from fusiond.errors import ConfigError
from fusiond.models.contract import Process, Sensor, flatten
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot


def describe(process: Process, *, beacons: list[list[float]], height_m: float = 0.0) -> Sensor:
    """Describe the sensor.

    Args:
        beacons: rows of number, x_m, y_m.   height_m: of every beacon above the plane of the antenna.
    """
    if not beacons or any(len(row) != 3 for row in beacons):
        raise ConfigError("beacons: needs at least one row of [number, x_m, y_m]")
    process.slot("x")
    process.slot("y")
    return Sensor(
        channels=(Slot("range", "m"), Slot("beacon")),
        measured=1,
        reads=("x", "y"),
        parameters=(height_m, float(len(beacons)), *flatten(beacons)),
        indices=tuple(row[0] for row in beacons),
    )


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """Distance, its gradient zero on top of the beacon; False for a number nobody configured."""
    for i in range(int(p[1])):
        if p[2 + 3 * i] == z[1]:
            east, north = x[at[0]] - p[3 + 3 * i], x[at[1]] - p[4 + 3 * i]
            h[0] = (east * east + north * north + p[0] * p[0]) ** 0.5
            if h[0] > 0.0:
                H[0, at[0]] = east / h[0]
                H[0, at[1]] = north / h[0]
            return True
    return False
