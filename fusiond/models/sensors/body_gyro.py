"""A gyro about the vertical axis of a `slipping_robot`: z = body_rate + gyro_bias + v, rad/s.

The body's rate is no state: it is what the wheels turn less what they err, so the gyro tells how they err.
"""

from __future__ import annotations

from fusiond.errors import ConfigError
from fusiond.models.contract import Process, Sensor
from fusiond.models.slipping_robot import TRACK, body_rate
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot

READS = ("wheel_turning", "speed", "wheel_mismatch", "track_error", "turn_slip", "gyro_bias")


def describe(process: Process) -> Sensor:
    """Describe the sensor."""
    if not process.has("wheel_turning", "gyro_bias"):
        raise ConfigError("kind: `body_gyro` needs a `slipping_robot` with `gyro = true`; set it in [model]")
    return Sensor(channels=(Slot("yaw_rate", "rad_s"),), reads=READS, parameters=(process.parameters[TRACK],))


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """The body's rate and the gyro's bias."""
    share = 1.0 - x[at[3]] - x[at[4]]
    turned = body_rate(x[at[0]], x[at[1]], x[at[2]], 1.0, p[0])
    h[0] = share * turned + x[at[5]]
    H[0, at[0]] = share
    H[0, at[1]] = -share * x[at[2]] / p[0]
    H[0, at[2]] = -share * x[at[1]] / p[0]
    H[0, at[3]] = H[0, at[4]] = -turned
    H[0, at[5]] = 1.0
    return True
