"""The simulated systems by name: `simulate("minicar", seed=0, duration_s=30.0)`."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from fusiond.errors import ConfigError
from fusiond.simulation import systems
from fusiond.simulation.arrivals import PerSensor, arrive
from fusiond.simulation.faults import parse_faults
from fusiond.simulation.faults_injection import Injection
from fusiond.simulation.options import number
from fusiond.simulation.tables import Reading, Simulation, Truth
from fusiond.types import nanoseconds


@dataclass(frozen=True, slots=True)
class System:
    """build(seed, duration_ns, lies, **options) -> readings in any order and the truth; and its usual length."""

    build: Callable[..., tuple[list[Reading], Truth]]
    usual_duration_s: float

    @property
    def options(self) -> tuple[str, ...]:
        """The names of its own options."""
        parameters = inspect.signature(self.build).parameters.values()
        return tuple(p.name for p in parameters if p.kind is inspect.Parameter.KEYWORD_ONLY)


SYSTEMS: dict[str, System] = {
    "minicar": System(systems.minicar, 30.0),
    "birotor": System(systems.birotor, 30.0),
    "wall_robot": System(systems.wall_robot, 10.0),
    "reference_plant": System(systems.reference_plant, 100.0),
    "constant_velocity": System(systems.constant_velocity, 100.0),
    "planar": System(systems.planar, 60.0),
    "square_robot": System(systems.square_robot, 22.0),
    "square_robot_gyro": System(systems.square_robot_gyro, 22.0),
    "ground_vehicle": System(systems.ground_vehicle, 9.5),
}


def simulate(
    name: str,
    seed: int = 0,
    duration_s: float | None = None,
    *,
    delay_s: PerSensor = 0.0,
    jitter_s: PerSensor = 0.0,
    inject: Sequence[str] = (),
    **options: object,
) -> Simulation:
    """Run one system.

    Args:
        name: a key of SYSTEMS.   seed: of everything random, >= 0.
        duration_s: > 0, default the system's usual one.
        delay_s, jitter_s: how late readings arrive (`arrivals.arrive`), one number or one per sensor.
        inject: faults of its sensors, as specifications (`faults`).
        options: the system's own (`systems`).
    Raises:
        ConfigError: an unknown system, option or fault, or a number out of its range.
    """
    if name not in SYSTEMS:
        raise ConfigError(f"simulate: no system {name!r}; choose one of {', '.join(SYSTEMS)}")
    system = SYSTEMS[name]
    unknown = set(options) - set(system.options)
    if unknown:
        raise ConfigError(
            f"simulate {name}: no option {', '.join(sorted(unknown))}; "
            f"choose from {', '.join((*system.options, 'delay_s', 'jitter_s'))}"
        )
    length_s = system.usual_duration_s if duration_s is None else duration_s
    _check(name, seed, length_s, delay_s, jitter_s)
    faults = parse_faults(inject)
    readings, truth = system.build(
        seed, nanoseconds(length_s), lambda sensors: Injection(faults, sensors, seed), **options
    )
    _check_sensors(name, readings, delay_s, jitter_s)
    arrived, arrivals_ns = arrive(readings, seed, delay_s, jitter_s)
    return Simulation(name, seed, arrived, arrivals_ns, truth)


def _check(name: str, seed: int, length_s: float, *settings: PerSensor) -> None:
    if not (math.isfinite(length_s) and length_s > 0.0):
        raise ConfigError(f"simulate {name}: duration {length_s} s is not above 0; give a length in seconds")
    if seed < 0:
        raise ConfigError(f"simulate {name}: seed {seed} is below 0; give a whole number from 0 up")
    for setting in settings:
        for late_s in setting.values() if isinstance(setting, Mapping) else (setting,):
            number("delay or jitter", late_s, 0.0)


def _check_sensors(name: str, readings: list[Reading], *settings: PerSensor) -> None:
    there = {reading.sensor for reading in readings}
    for setting in settings:
        absent = set(setting) - there if isinstance(setting, Mapping) else set()
        if absent:
            raise ConfigError(
                f"simulate {name}: a delay for {', '.join(sorted(absent))}, which is silent; "
                f"choose from {', '.join(sorted(there))}"
            )
