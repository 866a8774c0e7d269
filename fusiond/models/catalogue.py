"""Every built-in model by the `kind` a configuration names."""

from __future__ import annotations

from types import ModuleType

from fusiond.models import (
    driven_point_mass,
    driven_position,
    driven_robot,
    ground_vehicle,
    linear,
    planar_body,
    planar_constant_velocity,
    planar_robot,
    single_track,
    slipping_robot,
    strapdown,
)
from fusiond.models.sensors import (
    attitude,
    barometer,
    beacon_range,
    body_gyro,
    direct,
    gnss_position,
    gnss_velocity,
    gps_course,
    gps_position,
    heading,
    magnetic_field,
    radar,
    tracklet,
    vehicle_course,
    wheel_pair,
    wheel_speed,
    wheel_velocity,
    yaw_rate,
    zero_velocity,
)
from fusiond.models.sensors import linear as linear_sensor

PROCESSES: dict[str, ModuleType] = {
    "driven_point_mass": driven_point_mass,
    "driven_position": driven_position,
    "driven_robot": driven_robot,
    "ground_vehicle": ground_vehicle,
    "linear": linear,
    "planar_body": planar_body,
    "planar_constant_velocity": planar_constant_velocity,
    "planar_robot": planar_robot,
    "single_track": single_track,
    "slipping_robot": slipping_robot,
    "strapdown": strapdown,
}

SENSORS: dict[str, ModuleType] = {
    "attitude": attitude,
    "barometer": barometer,
    "beacon_range": beacon_range,
    "body_gyro": body_gyro,
    "direct": direct,
    "gnss_position": gnss_position,
    "gnss_velocity": gnss_velocity,
    "gps_course": gps_course,
    "gps_position": gps_position,
    "heading": heading,
    "linear": linear_sensor,
    "magnetic_field": magnetic_field,
    "radar": radar,
    "tracklet": tracklet,
    "vehicle_course": vehicle_course,
    "wheel_pair": wheel_pair,
    "wheel_speed": wheel_speed,
    "wheel_velocity": wheel_velocity,
    "yaw_rate": yaw_rate,
    "zero_velocity": zero_velocity,
}
