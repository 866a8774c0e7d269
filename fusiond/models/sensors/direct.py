"""A reading of named states as they are: position, yaw rate, wheel speed, heading, anything a state stands for."""

from __future__ import annotations

from fusiond.errors import ConfigError
from fusiond.models.contract import Process, Sensor
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector


def describe(process: Process, *, slots: list[str]) -> Sensor:
    """Describe the sensor.

    Args:
        slots: names of the states it reads, one channel each, in their units.
    """
    if not slots or len(set(slots)) < len(slots):
        raise ConfigError(f"slots: {slots} names no state or one twice; name each state that it reads once")
    return Sensor(
        channels=tuple(process.slot(name) for name in slots),
        reads=tuple(slots),
        wraps=tuple(name for name in slots if name in process.angles),
    )


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """h_i = x[at_i]."""
    for i in range(min(h.shape[0], at.shape[0])):
        if at[i] >= 0:
            h[i] = x[at[i]]
            H[i, at[i]] = 1.0
    return True
