"""Velocity of an antenna that sits off the IMU: z = v + R(q) (rate x lever) + v, m/s, in the axes of the local frame.

The rate is the gyro's last, less its bias. Its noise, times the lever, is left out: state it in the sensor's.
"""

from __future__ import annotations

from fusiond.models.contract import Process, Sensor
from fusiond.models.rigid import ATTITUDE, BIAS, RATE, require_attitude, three
from fusiond.numerics.kernel import kernel
from fusiond.numerics.quaternion import cross, rotation_of, turned, unit
from fusiond.numerics.ud import Matrix, Vector


def describe(process: Process, *, lever_m: list[float] | None = None, horizontal: bool = False) -> Sensor:
    """Describe the sensor.

    Args:
        lever_m: [x, y, z] of the antenna seen from the IMU, in the axes of the body.
        horizontal: it reads vx and vy only.
    """
    require_attitude(process, "kind")
    names = ("vx", "vy") if horizontal else ("vx", "vy", "vz")
    return Sensor(
        channels=tuple(process.slot(name) for name in names),
        reads=("vx", ATTITUDE, BIAS, RATE),
        parameters=(*three(lever_m, "lever_m"), float(len(names))),
    )


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """Velocity plus that of the lever's end; a gyro bias e more moves it by -R (e x lever)."""
    velocity, attitude, bias, rate = at[0], at[1], at[2], at[3]
    R = rotation_of(x, attitude)
    lever = (p[0], p[1], p[2])
    turning = (x[rate] - x[bias], x[rate + 1] - x[bias + 1], x[rate + 2] - x[bias + 2])
    swing = cross(turning, lever)
    moved = turned(R, swing[0], swing[1], swing[2])
    for j in range(3):
        by_turn = cross(unit(j), moved)
        arm = cross(unit(j), lever)
        by_bias = turned(R, arm[0], arm[1], arm[2])
        for i in range(int(p[3])):
            H[i, attitude + j] = by_turn[i]
            H[i, bias + j] = -by_bias[i]
    for i in range(int(p[3])):
        h[i] = x[velocity + i] + moved[i]
        H[i, velocity + i] = 1.0
    return True
