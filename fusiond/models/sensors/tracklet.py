"""What another machine learnt from one reading: the reading, and its model linearised at an estimate of that time.

    h(x) = h_there + H (x - x_there),   z = [measured; h_there; H row by row; x_there]

H and x_there have the columns that the sensor's model reads; differences of angles are taken on the circle. H' R^-1
(z - h) and H' R^-1 H are the increments of the full-rate information sum (`fusiond.fusion.information_sum`): whoever
fuses them needs no model of the sensor, and no prior is counted twice, since none is sent.
"""

from __future__ import annotations

import numpy as np

from fusiond.errors import ConfigError
from fusiond.models.contract import Process, Sensor, flatten, shape_of
from fusiond.numerics.discretise import wrap_angle
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot


def describe(
    process: Process,
    *,
    channels: list[str],
    reads: list[str],
    H: list[list[float]],
    units: list[str] | None = None,
    wraps: list[str] | None = None,
) -> Sensor:
    """Describe the sensor.

    Args:
        channels: names of the measured numbers.   units: theirs, none by default.   wraps: those that are angles, rad.
        reads: states that the sensor's own model reads.
        H: a row for each channel, a column for each of `reads`, at a typical state: what observability is judged by.
    """
    if process.errors:
        raise ConfigError("kind `tracklet` needs a state that is a vector; this model's attitude is none")
    shape_of("H", H, len(channels), len(reads))
    said = units if units is not None else [""] * len(channels)
    if len(said) != len(channels):
        raise ConfigError(f"units: are {len(said)} for {len(channels)} channels; give each one, `` for none")
    states = [process.slot(name) for name in reads]
    measured = tuple(Slot(name, unit) for name, unit in zip(channels, said, strict=True))
    circular = [float(name in process.angles) for name in reads]
    return Sensor(
        channels=(
            *measured,
            *(Slot(f"{slot.name}_there", slot.unit) for slot in measured),
            *(Slot(f"{slot.name}_by_{state.name}") for slot in measured for state in states),
            *(Slot(f"at_{state.name}", state.unit) for state in states),
        ),
        reads=tuple(reads),
        measured=len(measured),
        wraps=tuple(wraps or ()),
        parameters=(float(len(measured)), float(len(states)), *circular, *flatten(H)),
        # No reading may carry NaN, so at design time it stands for a reading not yet taken.
        indices=(float("nan"),),
    )


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """h = h_there + H (x - x_there); the typical H of the configuration, from zero, where no reading is taken yet."""
    m, r = int(p[0]), int(p[1])
    typical = np.isnan(z[m])
    for i in range(m):
        total = 0.0 if typical else z[m + i]
        for j in range(r):
            slope, apart = p[2 + r + i * r + j], x[at[j]]
            if not typical:
                slope = z[2 * m + i * r + j]
                apart -= z[2 * m + m * r + j]
                if p[2 + j] > 0.0:
                    apart = wrap_angle(apart)
            H[i, at[j]] = slope
            total += slope * apart
        h[i] = total
    return True
