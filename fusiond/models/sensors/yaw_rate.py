"""A gyro about the vertical axis: z = yaw_rate + gyro_bias + v (without a `gyro_bias` state: z = yaw_rate + v)."""

from __future__ import annotations

from fusiond.models.contract import Process, Sensor
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector


def describe(process: Process) -> Sensor:
    """Describe the sensor."""
    biased = process.has("gyro_bias")
    return Sensor(
        channels=(process.slot("yaw_rate"),),
        reads=("yaw_rate", "gyro_bias") if biased else ("yaw_rate",),
        parameters=(float(biased),),
    )


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """Yaw rate, plus the gyro's bias where it is a state."""
    h[0] = x[at[0]]
    H[0, at[0]] = 1.0
    if p[0] > 0.0:
        h[0] += x[at[1]]
        H[0, at[1]] = 1.0
    return True
