"""Position in the plane, in metres of the local frame, of an antenna that may sit off the centre.

z = p + R(yaw) lever + v;  without a `yaw` state the lever must be zero.
"""

from __future__ import annotations

import math

from fusiond.errors import ConfigError
from fusiond.models.contract import Process, Sensor
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector


def describe(process: Process, *, lever_forward_m: float = 0.0, lever_left_m: float = 0.0) -> Sensor:
    """Describe the sensor.

    Args:
        lever_forward_m, lever_left_m: the antenna seen from the robot's centre, in the body frame.
    """
    has_lever = lever_forward_m != 0.0 or lever_left_m != 0.0
    if has_lever and not process.has("yaw"):
        raise ConfigError("lever_forward_m: the process model has no `yaw`; set the lever to 0")
    return Sensor(
        channels=(process.slot("x"), process.slot("y")),
        reads=("x", "y", "yaw") if has_lever else ("x", "y"),
        parameters=(lever_forward_m, lever_left_m, float(has_lever)),
    )


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """Position plus the lever turned by the heading."""
    h[0] = x[at[0]]
    h[1] = x[at[1]]
    H[0, at[0]] = 1.0
    H[1, at[1]] = 1.0
    if p[2] > 0.0:
        cosine, sine = math.cos(x[at[2]]), math.sin(x[at[2]])
        h[0] += cosine * p[0] - sine * p[1]
        h[1] += sine * p[0] + cosine * p[1]
        H[0, at[2]] = -sine * p[0] - cosine * p[1]
        H[1, at[2]] = cosine * p[0] - sine * p[1]
    return True
