"""Speed over ground and course of a vehicle that points where it goes: z = [v along the course, yaw of the vehicle].

    h = [ v_x cos(course) + v_y sin(course),  course + w wrap(yaw + offset - course) ],   w = speed / |(speed, slow)|

with the course and speed that the reading itself carries: linear in the velocity and, over the whole circle, in the
heading, so that both are found from any start. Near standstill a receiver's course means nothing: w takes it away, at
the speed `slow` half of what it teaches. The course is atan2(v_y, v_x) in the local frame: a bearing where x is north.
It suits road vehicles and not what drifts (boats, aircraft in wind, robots that move sideways). The antenna's lever and
the slip of the tyres are left out: state them in the noise.
"""

from __future__ import annotations

import math

from fusiond.errors import ConfigError
from fusiond.models.contract import Process, Sensor
from fusiond.models.rigid import ATTITUDE, require_attitude
from fusiond.numerics.discretise import wrap_angle
from fusiond.numerics.kernel import kernel
from fusiond.numerics.quaternion import rotation_of, yaw_of
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Slot

STEEP = 1e-12
"""Square of the cosine of the pitch from which a yaw means something."""


def describe(process: Process, *, slow_m_s: float = 2.0, offset_rad: float = 0.0) -> Sensor:
    """Describe the sensor.

    Args:
        slow_m_s: speed below which the course is not believed any more; above 0.
        offset_rad: course minus yaw when driving straight ahead: how the IMU is turned in the vehicle.
    """
    require_attitude(process, "kind")
    if slow_m_s <= 0.0:
        raise ConfigError(
            f"slow_m_s: is {slow_m_s:g}; write the speed, above 0, below which a course is noise"
        )
    return Sensor(
        channels=(Slot("speed", "m_s"), Slot("course", "rad")),
        reads=("vx", ATTITUDE),
        wraps=("course",),
        parameters=(slow_m_s, offset_rad),
    )


@kernel
def observe(x: Vector, z: Vector, at: Vector, p: Vector, h: Vector, H: Matrix) -> bool:
    """Along the course that was read; a turn theta about the local axes turns the heading as in `attitude`."""
    velocity, first = at[0], at[1]
    R = rotation_of(x, first)
    along_x, along_y = math.cos(z[1]), math.sin(z[1])
    h[0] = along_x * x[velocity] + along_y * x[velocity + 1]
    H[0, velocity] = along_x
    H[0, velocity + 1] = along_y
    weight = abs(z[0]) / math.sqrt(z[0] * z[0] + p[0] * p[0])
    level = R[0][0] * R[0][0] + R[1][0] * R[1][0]
    h[1] = z[1]
    if level > STEEP:
        h[1] += weight * wrap_angle(yaw_of(R) + p[1] - z[1])
        H[1, first] = -weight * R[0][0] * R[2][0] / level
        H[1, first + 1] = -weight * R[1][0] * R[2][0] / level
        H[1, first + 2] = weight
    return True
