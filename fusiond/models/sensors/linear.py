"""A linear reading z = H x + v, its matrix in the configuration."""

from __future__ import annotations

from fusiond.errors import ConfigError
from fusiond.models.contract import Process, Sensor, flatten, shape_of
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot


def describe(process: Process, *, H: list[list[float]], channels: list[str] | None = None) -> Sensor:
    """Describe the sensor.

    Args:
        H: one row a channel, one column a state.   channels: their names; `z0`, `z1`, ... by default.
    """
    if not H:
        raise ConfigError("H: has no rows; write one for each number of a reading")
    shape_of("H", H, len(H), len(process.states))
    names = channels or [f"z{i}" for i in range(len(H))]
    if len(set(names)) != len(H):
        raise ConfigError(f"channels: {names} are not {len(H)} different names; give one for each row of H")
    return Sensor(
        channels=tuple(Slot(name) for name in names),
        reads=tuple(slot.name for slot in process.states),
        parameters=(float(len(H)), *flatten(H)),
    )


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """h = H x."""
    n = x.shape[0]
    for i in range(int(p[0])):
        total = 0.0
        for j in range(n):
            H[i, j] = p[1 + i * n + j]
            total += H[i, j] * x[j]
        h[i] = total
    return True
