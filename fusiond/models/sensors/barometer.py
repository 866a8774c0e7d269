"""Altitude of a barometer: z = s (p + R(q) lever)_z + altitude of the origin + v, m; s = 1 where z is up, else -1."""

from __future__ import annotations

from typing import Literal

from fusiond.models.contract import Process, Sensor
from fusiond.models.rigid import ATTITUDE, require_attitude, three
from fusiond.numerics.kernel import kernel
from fusiond.numerics.quaternion import cross, rotation_of, turned, unit
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot


def describe(
    process: Process,
    *,
    z_is: Literal["up", "down"],
    origin_m: float = 0.0,
    lever_m: list[float] | None = None,
) -> Sensor:
    """Describe the sensor.

    Args:
        z_is: where the local frame's z axis points: up in ENU, down in NED.
        origin_m: what it reads at the origin.
        lever_m: [x, y, z] of the barometer seen from the IMU, in the axes of the body.
    """
    require_attitude(process, "kind")
    process.slot("z")
    return Sensor(
        channels=(Slot("altitude", "m"),),
        reads=("z", ATTITUDE),
        parameters=(*three(lever_m, "lever_m"), 1.0 if z_is == "up" else -1.0, origin_m),
    )


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """Height of the lever's end above the origin, and the altitude of the origin."""
    arm = turned(rotation_of(x, at[1]), p[0], p[1], p[2])
    h[0] = p[3] * (x[at[0]] + arm[2]) + p[4]
    H[0, at[0]] = p[3]
    for j in range(3):
        H[0, at[1] + j] = p[3] * cross(unit(j), arm)[2]
    return True
