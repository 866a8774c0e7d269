"""Truth from somebody else's simulator: the 29-state multi-body car of commonroad-vehicle-models, driven by us.

Its frame has z downward and y to the right, so a positive yaw turns to its right; it is mirrored here by reading y as
"to the left", which changes nothing else because left and right wheels are driven alike.

    steering   the road wheels' angular velocity is held over a millisecond so that the angle follows the manoeuvre
    speed      the longitudinal command, an acceleration, is a proportional driver's: 2 / s times the speed missing
    forces     the command times the mass, split as the car's parameters say: brake 66 % in front, engine all rear
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np

from fusiond.errors import ConfigError
from fusiond.simulation.tables import Floats
from fusiond.simulation.vehicle_manoeuvres import Manoeuvre
from fusiond.simulation.vehicle_sensors import MILLISECOND_NS, Motion

STEP_S = 1e-3
DRIVER_PER_S = 2.0
X, Y, STEERING, VX, YAW, YAW_RATE, VY = 0, 1, 2, 3, 4, 5, 10
"""Places in the simulator's state."""
RightSide = Callable[[list[float], tuple[float, float], Any], list[float]]


@dataclass(frozen=True, slots=True)
class Simulator:
    """The package's equations and the parameters of its BMW 320i."""

    right_side: RightSide
    begin: Callable[[list[float], Any], list[float]]
    parameters: Any


def plain(values: Any) -> Any:
    """The same parameters as a plain namespace: the package's own checks every access, which takes ten times longer."""
    if is_dataclass(values):
        return SimpleNamespace(**{field.name: plain(getattr(values, field.name)) for field in fields(values)})
    return values


@cache
def simulator() -> Simulator:
    """Load the package; raises ConfigError where it is not installed."""
    try:
        from vehiclemodels.init_mb import init_mb  # type: ignore[import-untyped]
        from vehiclemodels.parameters_vehicle2 import parameters_vehicle2  # type: ignore[import-untyped]
        from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb  # type: ignore[import-untyped]
    except ImportError as error:
        raise ConfigError(
            f"vehicle: the multi-body simulator cannot be loaded ({error}); install commonroad-vehicle-models~=3.0"
        ) from error
    return Simulator(vehicle_dynamics_mb, init_mb, plain(parameters_vehicle2()))


def runge_kutta(car: Simulator, x: Floats, u: tuple[float, float], h_s: float) -> Floats:
    """(29,) the state h_s later, under a held command; the package is handed copies, since it may change them."""

    def slope(at: Floats) -> Floats:
        return np.array(car.right_side(at.tolist(), u, car.parameters))

    k1 = slope(x)
    k2 = slope(x + 0.5 * h_s * k1)
    k3 = slope(x + 0.5 * h_s * k2)
    k4 = slope(x + h_s * k3)
    return np.asarray(x + h_s / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4), dtype=np.float64)


def wheel_forces(car: Simulator, command_m_s2: float) -> list[float]:
    """Front left, front right, rear left, rear right, N: the longitudinal command as the parameters split it."""
    p = car.parameters
    front = p.T_se if command_m_s2 > 0.0 else p.T_sb
    half = 0.5 * p.m * command_m_s2
    return [front * half, front * half, (1.0 - front) * half, (1.0 - front) * half]


def drive(
    car: Simulator, speed_m_s: float, steering_rad: Callable[[float], float], duration_s: float
) -> Motion:
    """Drive for a while, starting straight ahead at that speed.

    The mean specific force of a millisecond is what its change of velocity leaves once the turning of the frame is
    taken off (trapezoid). The axle forces in the motion are the pair that gives a rigid car of this mass and inertia
    the lateral specific force and the yaw acceleration of the millisecond: the simulator has no single such pair.
    """
    steps = round(duration_s / STEP_S)
    raw = np.zeros((steps + 1, 29))
    raw[0] = car.begin([0.0, 0.0, steering_rad(0.0), speed_m_s, 0.0, 0.0, 0.0], car.parameters)
    drive_n = np.zeros((steps + 1, 4))
    for k in range(steps):
        command = DRIVER_PER_S * (speed_m_s - raw[k, VX])
        turning = (steering_rad((k + 1) * STEP_S) - raw[k, STEERING]) / STEP_S
        drive_n[k] = wheel_forces(car, command)
        raw[k + 1] = runge_kutta(car, raw[k], (turning, command), STEP_S)
    drive_n[steps] = drive_n[steps - 1]
    t_ns = np.arange(steps + 1, dtype=np.int64) * MILLISECOND_NS
    return Motion(t_ns, _states(car, raw, drive_n), drive_n, raw[:, STEERING].copy())


def _states(car: Simulator, raw: Floats, drive_n: Floats) -> Floats:
    """(n, 10) the columns of a Motion, from the simulator's 29."""
    p = car.parameters
    vx, vy, rate = raw[:, VX], raw[:, VY], raw[:, YAW_RATE]
    mean = 0.5 * (raw[1:] + raw[:-1])
    ax = np.diff(vx) / STEP_S - 0.5 * (vy[1:] * rate[1:] + vy[:-1] * rate[:-1])
    ay = np.diff(vy) / STEP_S + 0.5 * (vx[1:] * rate[1:] + vx[:-1] * rate[:-1])
    pushed = drive_n[:-1, 0] + drive_n[:-1, 1]
    cosine, sine = np.cos(mean[:, STEERING]), np.sin(mean[:, STEERING])
    across = p.m * ay - pushed * sine
    moment = p.I_z * np.diff(rate) / STEP_S - pushed * sine * p.a
    front = (moment + p.b * across) / ((p.a + p.b) * cosine)
    rear = across - front * cosine
    first = np.zeros((1, 4))
    late = np.vstack((first, np.column_stack((front, rear, ax, ay))))
    return np.column_stack(
        (vx, vy, rate, late[:, 0], late[:, 1], raw[:, YAW], raw[:, X], raw[:, Y], late[:, 2], late[:, 3])
    )


@cache
def manoeuvre(asked: Manoeuvre) -> Motion:
    """Drive one of the manoeuvres; the same arrays to everyone who asks."""
    return drive(simulator(), asked.speed_m_s, asked.steering_rad, asked.duration_s)
