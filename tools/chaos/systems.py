"""What is put through it: simulated systems with their configuration and fault detection."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.assembly import Assembly
from fusiond.assembly.course import rate_hz
from fusiond.demo.injecting import measured_of
from fusiond.engine.engine import Engine
from fusiond.engine.records import HAS_ARRIVAL, HAS_SEQ
from fusiond.simulation.tables import Simulation
from fusiond.types import Role
from tools.pages.trials import configured, records

PROMISE_S = 36_000.0
MEASURED = (Role.UPDATE, Role.INPUT)


@dataclass(frozen=True, slots=True)
class System:
    """One system.

    Args:
        config: its configuration, with `changes` by section.   simulated: name of the simulation, with its options.
        seconds: length of a run.
    """

    config: str
    simulated: str
    seconds: float
    changes: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)


POSITION = {
    "kind": "linear",
    "H": [[1.0, 0.0]],
    "channels": ["y"],
    "rate_hz": 10.0,
    "noise_std": {"y": 0.1},
}


SYSTEMS: dict[str, System] = {
    "minicar": System("minicar", "minicar", 30.0),
    "wall_robot": System("wall_robot", "wall_robot", 20.0),
    "reference_plant": System("reference_plant", "reference_plant", 300.0),
    "three_positions": System(
        "constant_velocity",
        "constant_velocity",
        100.0,
        {"sensor": {"y2": POSITION, "y3": POSITION}},
        {"R": (0.01, 0.01, 0.01)},
    ),
    "vehicle": System(
        "planar",
        "planar",
        40.0,
        {
            "model": {
                "acceleration_noise_m_s2_sqrt_hz": 1.0,
                "yaw_acceleration_noise_rad_s2_sqrt_hz": 0.14,
            },
            "sensor": {"heading": None, "beacon": None, "radar": None},
        },
        {"aboard": ("gps", "wheel_speed", "gyro"), "motion": "smooth"},
    ),
}


@dataclass(frozen=True)
class Rig:
    """A system's engine, and what its sensors measure."""

    assembly: Assembly
    engine: Engine

    @functools.cached_property
    def sigma(self) -> dict[str, float]:
        """Noise of the first channel of every sensor and measured input, in its unit."""
        measured = {sensor.name for sensor in self.assembly.layout.sensors if sensor.role in MEASURED}
        known = {of.name: of.sigma for of in measured_of(self.assembly) if of.name in measured}
        return {name: sigma[0] for name, sigma in known.items() if sigma and sigma[0] > 0.0}

    @functools.cached_property
    def slowest_hz(self) -> float:
        """Rate of the slowest of them."""
        return min(
            rate_hz(self.assembly.resolved, s) for s in self.assembly.resolved.sensors if s.name in self.sigma
        )

    def log(self, simulation: Simulation) -> NDArray[Any]:
        """Its readings in order of arrival, numbered and with the time they came."""
        layout = self.assembly.layout
        log = records(layout, simulation.readings)
        known = [reading.sensor in layout.numbers for reading in simulation.readings]
        log["arrival_ns"] = simulation.arrivals_ns[np.array(known)]
        log["flags"] |= HAS_ARRIVAL | HAS_SEQ
        for sensor in layout.sensors:
            rows = np.flatnonzero(log["sensor"] == sensor.number)
            log["seq"][rows[np.argsort(log["t_ns"][rows], kind="stable")]] = np.arange(1, rows.size + 1)
        return log


@functools.cache
def rig(name: str) -> Rig:
    """A system ready to run; compiled once a process."""
    system = SYSTEMS[name]
    promise = {"faults": {"mean_time_between_false_alarms_s": PROMISE_S}}
    assembly = configured(system.config, {**system.changes, **promise})
    return Rig(assembly, assembly.engine())
