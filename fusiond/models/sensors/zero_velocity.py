"""Standing still: z = (v, rate - gyro_bias) + v, six zeros from whoever knows it (a brake, a foot, a contactor).

The turning is that of the gyro's last reading, so a still device also learns the gyro's bias; its noise is the gyro's.
"""

from __future__ import annotations

from fusiond.models.contract import Process, Sensor
from fusiond.models.rigid import BIAS, RATE, require_attitude
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector


def describe(process: Process, *, turning: bool = True) -> Sensor:
    """Describe the sensor.

    Args:
        turning: it does not turn either: three zeros of angular rate follow those of velocity.
    """
    require_attitude(process, "kind")
    names = ["vx", "vy", "vz", *(["rate_x", "rate_y", "rate_z"] if turning else [])]
    return Sensor(
        channels=tuple(process.slot(name) for name in names),
        reads=("vx", BIAS, RATE),
        parameters=(float(turning),),
    )


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """Velocity, and the angular rate without its bias."""
    for i in range(3):
        h[i] = x[at[0] + i]
        H[i, at[0] + i] = 1.0
        if p[0] > 0.0:
            h[3 + i] = x[at[2] + i] - x[at[1] + i]
            H[3 + i, at[1] + i] = -1.0
    return True
