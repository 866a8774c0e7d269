"""The magnetic field in the axes of the magnetometer: z = M' R(q)' field + v, hard and soft iron taken off before."""

from __future__ import annotations

from fusiond.errors import ConfigError
from fusiond.models.contract import Process, Sensor
from fusiond.models.rigid import ATTITUDE, mounting, require_attitude, three
from fusiond.numerics.kernel import kernel
from fusiond.numerics.quaternion import cross, rotation_from, rotation_of, turned_back, unit
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot


def describe(
    process: Process, *, field: list[float], unit: str = "ut", mounting_rad: list[float] | None = None
) -> Sensor:
    """Describe the sensor.

    Args:
        field: [x, y, z] of the earth's field at the place, in the axes of the local frame. With declination D (east
            of north), inclination I (below the horizon) and strength m it is m [cos I cos D, cos I sin D, sin I]
            in NED and m [cos I sin D, cos I cos D, -sin I] in ENU.
        unit: of field and readings.   mounting_rad: [roll, pitch, yaw] of its axes seen from the body's.
    """
    require_attitude(process, "kind")
    earth = three(field, "field")
    if not any(earth):
        raise ConfigError("field: is zero, so that nothing can be read from it; write the field at the place")
    return Sensor(
        channels=tuple(Slot(f"field_{axis}", unit) for axis in "xyz"),
        reads=(ATTITUDE,),
        parameters=(*earth, *mounting(mounting_rad, "mounting_rad")),
    )


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """The field turned back; a turn theta of the body changes it by R' (field x theta)."""
    R, M = rotation_of(x, at[0]), rotation_from(p, 3)
    earth = (p[0], p[1], p[2])
    for j in range(4):
        seen = earth if j == 3 else cross(earth, unit(j))
        body = turned_back(R, seen[0], seen[1], seen[2])
        own = turned_back(M, body[0], body[1], body[2])
        for i in range(3):
            if j == 3:
                h[i] = own[i]
            else:
                H[i, at[0] + j] = own[i]
    return True
