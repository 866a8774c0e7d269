"""From a row's fields to SI numbers: scale, conversion, projection, rotation."""

from __future__ import annotations

import math

from fusiond.recording.importing.mapping import Value
from fusiond.recording.importing.rows import Row

EQUATOR_M = 6_378_137.0
"""Semi-major axis of WGS-84, m."""
ECCENTRICITY_2 = 6.694_379_990_141e-3
"""Square of the first eccentricity of WGS-84."""


class Projection:
    """Local tangent plane round an origin, equirectangular on the WGS-84 radii of curvature.

    east = N cos(lat0) (lon - lon0), north = M (lat - lat0), with N and M the prime vertical's and the
    meridian's radius at lat0. Wrong by about d^2 tan(lat0) / (2 N) at a distance d from the origin: 0.1 m at
    1 km in Europe.
    """

    def __init__(self, origin_deg: tuple[float, float] | None) -> None:
        self._origin_deg = origin_deg

    def east_north_m(self, latitude_deg: float, longitude_deg: float) -> tuple[float, float]:
        """East and north of the origin, m; without one, the first call's position becomes it."""
        if self._origin_deg is None:
            self._origin_deg = (latitude_deg, longitude_deg)
        lat0, lon0 = map(math.radians, self._origin_deg)
        curvature = 1.0 - ECCENTRICITY_2 * math.sin(lat0) ** 2
        prime_vertical_m = EQUATOR_M / math.sqrt(curvature)
        meridian_m = EQUATOR_M * (1.0 - ECCENTRICITY_2) / curvature**1.5
        east_rad = wrapped(math.radians(longitude_deg) - lon0)
        return prime_vertical_m * math.cos(lat0) * east_rad, meridian_m * (math.radians(latitude_deg) - lat0)


def geodetic(x_m: float, y_m: float, z_m: float) -> tuple[float, float, float]:
    """Latitude deg, longitude deg and height above the WGS-84 ellipsoid, m, of an earth-fixed (ECEF) position.

    The usual fixed point for the latitude, whose error shrinks by e^2 = 0.0067 each time: below 1 um after five. The
    height is the projection on the vertical, sound at the poles too.
    """
    across_m = math.hypot(x_m, y_m)
    latitude = math.atan2(z_m, across_m * (1.0 - ECCENTRICITY_2))
    for _ in range(5):
        prime_vertical_m = EQUATOR_M / math.sqrt(1.0 - ECCENTRICITY_2 * math.sin(latitude) ** 2)
        latitude = math.atan2(z_m + ECCENTRICITY_2 * prime_vertical_m * math.sin(latitude), across_m)
    sine, cosine = math.sin(latitude), math.cos(latitude)
    curvature = math.sqrt(1.0 - ECCENTRICITY_2 * sine**2)
    height_m = across_m * cosine + z_m * sine - EQUATOR_M * curvature
    return math.degrees(latitude), math.degrees(math.atan2(y_m, x_m)), height_m


class Frames:
    """What numbers are turned by: the local tangent plane, and the newest orientation of the body."""

    def __init__(self, origin_deg: tuple[float, float] | None) -> None:
        self.projection = Projection(origin_deg)
        self.attitude: tuple[float, float, float, float] | None = None

    def level(self, x: float, y: float, z: float) -> tuple[float, float]:
        """The horizontal part of a body-fixed vector, ahead and to the left of the body's yaw.

        Raises: ValueError before the first orientation.
        """
        if self.attitude is None:
            raise ValueError("no orientation came before it")
        qx, qy, qz, qw = self.attitude
        east = (1 - 2 * (qy * qy + qz * qz)) * x + 2 * (qx * qy - qw * qz) * y + 2 * (qx * qz + qw * qy) * z
        north = 2 * (qx * qy + qw * qz) * x + (1 - 2 * (qx * qx + qz * qz)) * y + 2 * (qy * qz - qw * qx) * z
        yaw = yaw_rad(qx, qy, qz, qw)
        return math.cos(yaw) * east + math.sin(yaw) * north, math.cos(yaw) * north - math.sin(yaw) * east


def wrapped(angle_rad: float) -> float:
    """The same angle within [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def yaw_rad(x: float, y: float, z: float, w: float) -> float:
    """Rotation about the vertical of a quaternion (z-y-x angles), counter-clockwise from the x axis."""
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def roll_rad(x: float, y: float, z: float, w: float) -> float:
    """Rotation of a quaternion about the body's x axis, the last of its z-y-x angles."""
    return math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))


def pitch_rad(x: float, y: float, z: float, w: float) -> float:
    """Rotation of a quaternion about the turned y axis, the second of its z-y-x angles: within a quarter turn."""
    return math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))


def number_of(value: Value, row: Row, frames: Frames) -> float:
    """One number of a reading. Raises: MissingField; ValueError where the row has no number there."""
    fields = [row.number(field) * value.field_scale for field in value.fields]
    if value.kind == "from":
        number = fields[0]
    elif value.kind == "roll_of":
        number = roll_rad(*fields)
    elif value.kind == "pitch_of":
        number = pitch_rad(*fields)
    elif value.kind == "yaw_of":
        number = yaw_rad(*fields)
    elif value.kind in ("forward_of", "left_of"):
        number = frames.level(*fields)[0 if value.kind == "forward_of" else 1]
    elif value.kind == "mean_of":
        number = math.fsum(fields) / len(fields)
    elif value.kind.startswith("ecef_"):
        number = on_the_plane(value.kind, geodetic(*fields), frames)
    else:
        number = frames.projection.east_north_m(*fields)[0 if value.kind == "east_of" else 1]
    number = converted(number, value.convert) * value.scale + value.offset
    return wrapped(number) if value.wrap else number


def on_the_plane(kind: str, place: tuple[float, float, float], frames: Frames) -> float:
    """East or north of the origin, or the altitude, of a geodetic place: `ecef_east_of` and its fellows."""
    if kind == "ecef_altitude_of":
        return place[2]
    return frames.projection.east_north_m(*place[:2])[0 if kind == "ecef_east_of" else 1]


def converted(number: float, convert: str) -> float:
    """A conversion by name; a course counts clockwise from north, a yaw counter-clockwise from east, within a
    turn.
    """
    if convert == "deg_to_rad":
        return math.radians(number)
    if convert == "km_h_to_m_s":
        return number / 3.6
    if convert == "course_deg_to_yaw_rad":
        return wrapped(math.pi / 2.0 - math.radians(number))
    return number
