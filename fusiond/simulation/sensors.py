"""Seeded sensors: what a healthy sensor makes of the truth.

Every sensor draws from its own stream (`streams.stream(seed, name)`), one draw per channel per reading, so a
sensor that is read in a live process makes the same readings as in a batch. Angles are wrapped to (-pi, pi].
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np

from fusiond.simulation.faults_injection import Measured
from fusiond.simulation.planar import PlanarState
from fusiond.simulation.plants import PointState
from fusiond.simulation.streams import stream
from fusiond.simulation.tables import Reading

State = TypeVar("State")
Law = Callable[[State, int], tuple[float, ...]]
BEACONS_M = ((0.0, 0.0), (60.0, 0.0), (60.0, 60.0), (0.0, 60.0))


def wrap(angle_rad: float) -> float:
    """The same angle in (-pi, pi]."""
    return math.pi - (math.pi - angle_rad) % (2.0 * math.pi)


@dataclass(slots=True)
class Sensor(Generic[State]):
    """z = law(state, n) + bias + noise, the n-th reading taken every period.

    law: the truth and the count of readings so far -> the exact values.   noise_std: per channel, 0 = exact.
    bias: a constant of the run, per channel.   angle_channels: wrapped after the noise.
    index_channels: how many of the last ones are no measurements but say of what, a beacon's number.
    """

    name: str
    period_ns: int
    noise_std: tuple[float, ...]
    law: Law[State]
    seed: int
    bias: tuple[float, ...] = ()
    angle_channels: tuple[int, ...] = ()
    index_channels: int = 0
    count: int = 0
    rng: np.random.Generator = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.rng = stream(self.seed, f"sensor/{self.name}")
        self.bias = self.bias or (0.0,) * len(self.noise_std)

    @property
    def measured(self) -> Measured:
        """What whoever lets it lie must know."""
        count = len(self.noise_std)
        dof = count - self.index_channels
        return Measured(self.name, count, dof, self.noise_std[:dof], frozenset(self.angle_channels))

    def is_due(self, t_ns: int) -> bool:
        """Whether a reading is stamped t_ns: at every multiple of the period."""
        return t_ns % self.period_ns == 0

    def read(self, t_ns: int, state: State) -> Reading:
        """One reading of this state."""
        exact = self.law(state, self.count)
        noise = self.rng.standard_normal(len(self.noise_std)).tolist()
        self.count += 1
        z = [e + b + s * n for e, b, s, n in zip(exact, self.bias, self.noise_std, noise, strict=True)]
        for channel in self.angle_channels:
            z[channel] = wrap(z[channel])
        return Reading(t_ns, self.name, tuple(z))


# on a line


def accelerometer(
    seed: int, bias_mean_m_s2: float = -0.97, bias_var: float = 1e-3, noise_var: float = 1e-4
) -> Sensor[PointState]:
    """Seed 000, table 1: x'' + bias + noise at 1 kHz; the bias is drawn once per run, variance 1e-3.

    It measures the kinematic acceleration (for the bi-rotor z'', not the specific force z'' + g): the seed
    puts what gravity does to the sensor into the offset (section 2.3). A reading stamped t is the mean over
    the millisecond that ends at t.
    """
    bias = bias_mean_m_s2 + math.sqrt(bias_var) * stream(seed, "bias/accelerometer").standard_normal()
    return Sensor(
        "accelerometer",
        1_000_000,
        (math.sqrt(noise_var),),
        lambda state, _: (state.acceleration_m_s2,),
        seed,
        bias=(bias,),
    )


def ultrasonic(seed: int, noise_var: float = 1e-4) -> Sensor[PointState]:
    """Seed 000, table 1: position every 30 ms with variance 1e-4 m^2."""
    std_m = math.sqrt(noise_var)
    return Sensor("ultrasonic", 30_000_000, (std_m,), lambda state, _: (state.position_m,), seed)


def range_finder(seed: int, noise_std_m: float = 0.03) -> Sensor[PointState]:
    """Seed 001: position every 0.1 s with a standard deviation (the seed says "variance") of 0.03 m."""
    return Sensor("range", 100_000_000, (noise_std_m,), lambda state, _: (state.position_m,), seed)


def speedometer(seed: int, noise_std_m_s: float = 0.2) -> Sensor[PointState]:
    """Seed 001: the velocity field of the state every 0.1 s, standard deviation 0.2 m/s.

    The wall robot hands it the mean velocity over the step that ends at the stamp.
    """
    return Sensor("speed", 100_000_000, (noise_std_m_s,), lambda state, _: (state.velocity_m_s,), seed)


# in the plane


def gps(seed: int, noise_std_m: float = 0.5) -> Sensor[PlanarState]:
    """[x, y] at 5 Hz."""
    std = (noise_std_m, noise_std_m)
    return Sensor("gps", 200_000_000, std, lambda state, _: (state.x_m, state.y_m), seed)


def wheel_speed(seed: int, noise_std_m_s: float = 0.1) -> Sensor[PlanarState]:
    """Speed along the body at 20 Hz."""
    return Sensor("wheel_speed", 50_000_000, (noise_std_m_s,), lambda state, _: (state.speed_m_s,), seed)


def gyro(seed: int, noise_std_rad_s: float = 0.01) -> Sensor[PlanarState]:
    """Yaw rate plus the state's gyro bias at 100 Hz."""
    return Sensor(
        "gyro",
        10_000_000,
        (noise_std_rad_s,),
        lambda state, _: (state.yaw_rate_rad_s + state.gyro_bias_rad_s,),
        seed,
    )


def heading(seed: int, noise_std_rad: float = 0.02) -> Sensor[PlanarState]:
    """Yaw at 10 Hz, wrapped."""
    return Sensor(
        "heading", 100_000_000, (noise_std_rad,), lambda state, _: (state.yaw_rad,), seed, angle_channels=(0,)
    )


def beacon(
    seed: int, noise_std_m: float = 0.2, beacons_m: tuple[tuple[float, float], ...] = BEACONS_M
) -> Sensor[PlanarState]:
    """[range, id] at 10 Hz, the beacons 0, 1, 2, ... asked in turn; the id is exact."""

    def law(state: PlanarState, count: int) -> tuple[float, ...]:
        index = count % len(beacons_m)
        x_m, y_m = beacons_m[index]
        return math.hypot(state.x_m - x_m, state.y_m - y_m), float(index)

    return Sensor("beacon", 100_000_000, (noise_std_m, 0.0), law, seed, index_channels=1)


def radar(seed: int, noise_std: tuple[float, float, float] = (0.3, 0.03, 0.3)) -> Sensor[PlanarState]:
    """[range m, bearing rad, range rate m/s] of the vehicle at 10 Hz, from a radar that stands at the origin.

    At the origin itself the range rate is undefined and given as 0.
    """

    def law(state: PlanarState, _: int) -> tuple[float, ...]:
        rho = math.hypot(state.x_m, state.y_m)
        vx, vy = state.speed_m_s * math.cos(state.yaw_rad), state.speed_m_s * math.sin(state.yaw_rad)
        rate = (state.x_m * vx + state.y_m * vy) / rho if rho > 0.0 else 0.0
        return rho, math.atan2(state.y_m, state.x_m), rate

    return Sensor("radar", 100_000_000, noise_std, law, seed, angle_channels=(1,))


PLANAR_SENSORS: dict[str, Callable[..., Sensor[PlanarState]]] = {
    "gps": gps,
    "wheel_speed": wheel_speed,
    "gyro": gyro,
    "heading": heading,
    "beacon": beacon,
    "radar": radar,
}
