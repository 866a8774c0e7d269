"""Position of an antenna that sits off the IMU: z = p + R(q) lever + v, m, in the axes of the local frame."""

from __future__ import annotations

from fusiond.models.contract import Process, Sensor
from fusiond.models.rigid import ATTITUDE, require_attitude, three
from fusiond.numerics.kernel import kernel
from fusiond.numerics.quaternion import cross, rotation_of, turned, unit
from fusiond.numerics.ud import Matrix, Vector


def describe(process: Process, *, lever_m: list[float] | None = None, horizontal: bool = False) -> Sensor:
    """Describe the sensor.

    Args:
        lever_m: [x, y, z] of the antenna seen from the IMU, in the axes of the body.
        horizontal: it reads x and y only.
    """
    require_attitude(process, "kind")
    names = ("x", "y") if horizontal else ("x", "y", "z")
    return Sensor(
        channels=tuple(process.slot(name) for name in names),
        reads=("x", ATTITUDE),
        parameters=(*three(lever_m, "lever_m"), float(len(names))),
    )


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """Position plus the lever turned by the attitude; a turn theta moves its end by theta x R lever."""
    position, attitude = at[0], at[1]
    arm = turned(rotation_of(x, attitude), p[0], p[1], p[2])
    for i in range(int(p[3])):
        h[i] = x[position + i] + arm[i]
        H[i, position + i] = 1.0
        for j in range(3):
            H[i, attitude + j] = cross(unit(j), arm)[i]
    return True
