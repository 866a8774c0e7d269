"""Every built-in model by the `kind` a configuration names."""

from __future__ import annotations

from types import ModuleType

from fusiond.models import (
    driven_point_mass,
    driven_position,
    ground_vehicle,
    linear,
    planar_body,
    planar_constant_velocity,
    planar_robot,
    single_track,
)
from fusiond.models.sensors import (
    beacon_range,
    direct,
    gps_course,
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
    "ground_vehicle": ground_vehicle,
    "linear": linear,
    "planar_body": planar_body,
    "planar_constant_velocity": planar_constant_velocity,
    "planar_robot": planar_robot,
    "single_track": single_track,
}

SENSORS: dict[str, ModuleType] = {
    "beacon_range": beacon_range,
    "direct": direct,
    "gps_course": gps_course,
    "gps_position": gps_position,
    "heading": heading,
    "linear": linear_sensor,
    "radar": radar,
    "wheel_speed": wheel_speed,
    "yaw_rate": yaw_rate,
}
