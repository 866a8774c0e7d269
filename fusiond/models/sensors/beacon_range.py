"""Range to a beacon whose number is the reading's second value: z = [scale * |p - beacon|, number].

All beacons of one sensor are of one kind and share its faults: one scale, one delay, one noise. Beacons that may err
apart from them are another sensor. The scale is a number, or a state that the filter estimates (`scale_state`).
"""

from __future__ import annotations

from fusiond.errors import ConfigError
from fusiond.models.contract import Process, Sensor, flatten
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot

FIRST = 4
"""Place of the first beacon among the parameters: height, scale, flags of the reads, count, then these."""


def describe(
    process: Process,
    *,
    beacons: list[list[float]],
    height_m: float = 0.0,
    scale: float = 1.0,
    scale_state: str | None = None,
) -> Sensor:
    """Describe the sensor.

    Args:
        beacons: rows of number, x_m, y_m; or of number, x_m, y_m, z_m where the model has a state `z`.
        height_m: of every beacon above the plane of the antenna, without z_m.
        scale: reading over true distance, where it is known.
        scale_state: a state that is the reading over the true distance; it multiplies `scale`.
    """
    widths = {len(row) for row in beacons}
    if widths not in ({3}, {4}):
        raise ConfigError(
            "beacons: needs at least one row of [number, x_m, y_m], or all of [.., .., .., z_m]"
        )
    numbers = [row[0] for row in beacons]
    if len(set(numbers)) < len(numbers):
        raise ConfigError("beacons: a number stands there twice; give each beacon its own")
    if scale <= 0.0:
        raise ConfigError(f"scale: is {scale:g}; write reading over true distance, 1 where it is not known")
    in_space = widths == {4}
    reads = ("x", "y", *(("z",) if in_space else ()), *((scale_state,) if scale_state else ()))
    for name in reads:
        process.slot(name)
    flags = 2.0 * float(in_space) + float(scale_state is not None)
    return Sensor(
        channels=(Slot("range", "m"), Slot("beacon")),
        measured=1,
        reads=reads,
        parameters=(
            height_m, scale, flags, float(len(beacons)),
            *flatten([[*row, 0.0][:4] for row in beacons]),
        ),
        indices=tuple(numbers),
    )  # fmt: skip


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """Distance times scale, its gradient zero on top of the beacon; False for a number nobody configured."""
    in_space, scaled = p[2] >= 2.0, p[2] % 2.0 > 0.0
    axes = 3 if in_space else 2
    for i in range(int(p[3])):
        beacon = FIRST + 4 * i
        if p[beacon] != z[1]:
            continue
        square = 0.0 if in_space else p[0] * p[0]
        for axis in range(axes):
            square += (x[at[axis]] - p[beacon + 1 + axis]) ** 2
        distance = square**0.5
        scale = p[1] * x[at[axes]] if scaled else p[1]
        h[0] = scale * distance
        if distance > 0.0:
            for axis in range(axes):
                H[0, at[axis]] = scale * (x[at[axis]] - p[beacon + 1 + axis]) / distance
        if scaled:
            H[0, at[axes]] = p[1] * distance
        return True
    return False
