"""Lever arms and mountings as configurations say them: where a device sits on a rigid body, and how it is turned."""

from __future__ import annotations

from collections.abc import Sequence

from fusiond.errors import ConfigError
from fusiond.models.contract import Process
from fusiond.numerics.kernel import interpreted
from fusiond.numerics.quaternion import from_angles, rotation_of

ATTITUDE, BIAS, RATE = "qw", "gyro_bias_x", "rate_x"
"""First of the states that a lever arm needs; their fellows follow them (models.strapdown)."""


def three(said: Sequence[float] | None, subject: str, meaning: str = "x, y, z") -> tuple[float, float, float]:
    """Three numbers, zeros where nothing is said; raises ConfigError for another count."""
    if not said:
        return 0.0, 0.0, 0.0
    if len(said) != 3:
        raise ConfigError(f"{subject}: has {len(said)} numbers, needs 3; write [{meaning}]")
    return float(said[0]), float(said[1]), float(said[2])


def mounting(angles_rad: Sequence[float] | None, subject: str) -> tuple[float, ...]:
    """The nine numbers, row by row, of the matrix that turns vectors of the device into the body.

    Args:
        angles_rad: roll, pitch, yaw (z-y-x) of the device's axes seen from the body's.
    """
    turn = from_angles(*three(angles_rad, subject, "roll, pitch, yaw"))
    return tuple(number for row in interpreted(rotation_of)(turn, 0) for number in row)  # type: ignore[arg-type]


def require_attitude(process: Process, subject: str) -> None:
    """Raises ConfigError where the process model has no attitude as a quaternion that stands last but for rates."""
    if not process.has(ATTITUDE) or not process.errors:
        raise ConfigError(f'{subject}: the process model has no attitude `qw`; choose the model "strapdown"')
