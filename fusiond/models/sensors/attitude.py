"""Roll, pitch and yaw (z-y-x) of the body in the local frame, or some of them, rad: z = angles + offset + v.

An attitude sensor reads all three, a magnetic compass that levels itself yaw alone, an inclinometer roll and pitch.
At a pitch of a quarter turn roll and yaw are one: there their rows of H are zero and the reading teaches nothing.
"""

from __future__ import annotations

from typing import Literal

from fusiond.errors import ConfigError
from fusiond.models.contract import Process, Sensor
from fusiond.models.rigid import ATTITUDE, require_attitude
from fusiond.numerics.kernel import kernel
from fusiond.numerics.quaternion import pitch_of, roll_of, rotation_of, yaw_of
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot

ANGLES = ("roll", "pitch", "yaw")
STEEP = 1e-12
"""Square of the cosine of the pitch from which roll and yaw mean something."""


def describe(
    process: Process, *, angles: list[Literal["roll", "pitch", "yaw"]], offset_rad: list[float] | None = None
) -> Sensor:
    """Describe the sensor.

    Args:
        angles: what it reads, in its order.   offset_rad: reading minus angle, of each; zeros by default.
    """
    require_attitude(process, "kind")
    if not angles or len(set(angles)) < len(angles):
        raise ConfigError(f"angles: {angles} names none or one twice; name each angle that it reads once")
    offsets = offset_rad or [0.0] * len(angles)
    if len(offsets) != len(angles):
        raise ConfigError(
            f"offset_rad: has {len(offsets)} numbers for {len(angles)} angles; write one of each"
        )
    which = [float(ANGLES.index(angle)) for angle in angles]
    return Sensor(
        channels=tuple(Slot(angle, "rad") for angle in angles),
        reads=(ATTITUDE,),
        wraps=tuple(angles),
        parameters=(float(len(angles)), *which, *offsets),
    )


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """The angles of R; a turn theta about the local axes changes each column r of R by theta x r."""
    R, first = rotation_of(x, at[0]), at[0]
    count = int(p[0])
    level = R[0][0] * R[0][0] + R[1][0] * R[1][0]
    for i in range(count):
        h[i] = p[1 + count + i]
        if p[1 + i] == 0.0:
            h[i] += roll_of(R)
            if level > STEEP:
                H[i, first] = (R[1][1] * R[2][2] - R[1][2] * R[2][1]) / level
                H[i, first + 1] = (R[0][2] * R[2][1] - R[0][1] * R[2][2]) / level
        elif p[1 + i] == 1.0:
            h[i] += pitch_of(R)
            if level > STEEP:
                H[i, first] = -R[1][0] / level**0.5
                H[i, first + 1] = R[0][0] / level**0.5
        else:
            h[i] += yaw_of(R)
            if level > STEEP:
                H[i, first] = -R[0][0] * R[2][0] / level
                H[i, first + 1] = -R[1][0] * R[2][0] / level
                H[i, first + 2] = 1.0
    return True
