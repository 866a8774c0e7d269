"""Velocity in the axes of a wheeled base: z = M' (R(q)' v + rate x lever) times the wheels' scale + v, m/s.

A vehicle that neither slips sideways nor leaves the ground reads zero across and up: send these zeros with the speed,
and their deviation says how far it may slip. The rate is the gyro's last, less its bias.
"""

from __future__ import annotations

from typing import Literal

from fusiond.errors import ConfigError
from fusiond.models.contract import Process, Sensor
from fusiond.models.rigid import ATTITUDE, BIAS, RATE, mounting, require_attitude, three
from fusiond.numerics.kernel import kernel
from fusiond.numerics.quaternion import cross, rotation_from, rotation_of, turned_back, unit
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot

AXES = "xyz"


def describe(
    process: Process,
    *,
    axes: list[Literal["x", "y", "z"]],
    scale: float = 1.0,
    lever_m: list[float] | None = None,
    mounting_rad: list[float] | None = None,
) -> Sensor:
    """Describe the sensor.

    Args:
        axes: of the base, along which it reads: x ahead, y and z across as the body's.
        scale: reading over true velocity, from the wheels' radius.
        lever_m: [x, y, z] of the wheels' middle seen from the IMU, in the axes of the body.
        mounting_rad: [roll, pitch, yaw] of the base's axes seen from the body's.
    """
    require_attitude(process, "kind")
    if not axes or len(set(axes)) < len(axes):
        raise ConfigError(f"axes: {axes} names none or one twice; name each axis that it reads once")
    if scale == 0.0:
        raise ConfigError(
            "scale: is 0, so that nothing can be read from it; write reading over true velocity"
        )
    which = [float(AXES.index(axis)) for axis in axes]
    return Sensor(
        channels=tuple(Slot(f"body_v{axis}", "m_s") for axis in axes),
        reads=("vx", ATTITUDE, BIAS, RATE),
        parameters=(
            *three(lever_m, "lever_m"),
            *mounting(mounting_rad, "mounting_rad"),
            scale,
            float(len(axes)),
            *which,
        ),
    )


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """Column by column: what each part of the error does to the velocity of the base; the last is that itself."""
    velocity, attitude, bias, rate = at[0], at[1], at[2], at[3]
    R, M, lever = rotation_of(x, attitude), rotation_from(p, 3), (p[0], p[1], p[2])
    v = (x[velocity], x[velocity + 1], x[velocity + 2])
    turning = (x[rate] - x[bias], x[rate + 1] - x[bias + 1], x[rate + 2] - x[bias + 2])
    still = (0.0, 0.0, 0.0)
    for j in range(10):
        moved, turns = v, turning
        if j < 3:
            moved, turns = unit(j), still
        elif j < 6:
            moved, turns = cross(v, unit(j - 3)), still
        elif j < 9:
            moved, turns = still, unit(j - 6)
        swing = cross(turns, lever)
        ahead = turned_back(R, moved[0], moved[1], moved[2])
        base = turned_back(M, ahead[0] + swing[0], ahead[1] + swing[1], ahead[2] + swing[2])
        for i in range(int(p[13])):
            value = p[12] * base[int(p[14 + i])]
            if j < 3:
                H[i, velocity + j] = value
            elif j < 6:
                H[i, attitude + j - 3] = value
            elif j < 9:
                H[i, bias + j - 6] = -value
            else:
                h[i] = value
    return True
