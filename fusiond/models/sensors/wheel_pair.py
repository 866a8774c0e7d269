"""Encoders of the two driven wheels of a `slipping_robot`: what each runs over the ground by its nominal size, m/s.

    left  = speed + push_slip felt_acceleration - wheel_turning track / 2 + v
    right = speed + push_slip felt_acceleration + wheel_turning track / 2 + v

with the acceleration that was felt over the interval that ends here. Its bias times the slip, like the change of the
mean by unequal wheels, is a product of two small numbers and left out.
"""

from __future__ import annotations

from fusiond.errors import ConfigError
from fusiond.models.contract import Process, Sensor
from fusiond.models.slipping_robot import TRACK
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot


def describe(process: Process) -> Sensor:
    """Describe the sensor; the track is the process model's."""
    if not process.has("wheel_turning", "push_slip"):
        raise ConfigError("kind: `wheel_pair` reads the wheels of a `slipping_robot`; this model has none")
    return Sensor(
        channels=(Slot("left", "m_s"), Slot("right", "m_s")),
        reads=("speed", "push_slip", "wheel_turning", "felt_acceleration"),
        parameters=(0.5 * process.parameters[TRACK],),
    )


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """Speed of each wheel: the left one is at -p[0], the right one at p[0]."""
    for i in range(2):
        lever = p[0] if i else -p[0]
        h[i] = x[at[0]] + x[at[1]] * x[at[3]] + lever * x[at[2]]
        H[i, at[0]] = 1.0
        H[i, at[1]] = x[at[3]]
        H[i, at[2]] = lever
    return True
