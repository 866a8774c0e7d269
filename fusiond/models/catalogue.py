"""Every built-in model by the `kind` a configuration names."""

from __future__ import annotations

from types import ModuleType

from fusiond.models import (
    driven_point_mass,
    driven_position,
    linear,
    planar_constant_velocity,
    planar_robot,
)
from fusiond.models.sensors import (
    beacon_range,
    direct,
    gps_position,
    heading,
    radar,
    wheel_speed,
    yaw_rate,
)
from fusiond.models.sensors import linear as linear_sensor

PROCESSES: dict[str, ModuleType] = {
    "driven_point_mass": driven_point_mass,
    "driven_position": driven_position,
    "linear": linear,
    "planar_constant_velocity": planar_constant_velocity,
    "planar_robot": planar_robot,
}

SENSORS: dict[str, ModuleType] = {
    "beacon_range": beacon_range,
    "direct": direct,
    "gps_position": gps_position,
    "heading": heading,
    "linear": linear_sensor,
    "radar": radar,
    "wheel_speed": wheel_speed,
    "yaw_rate": yaw_rate,
}
