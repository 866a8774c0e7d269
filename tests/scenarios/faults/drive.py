"""Runs with faults, for scenarios: four configurations, each with one engine that every run resets.

    run = scene("minicar").drive(20.0, inject=["ultrasonic.bias=0.5@10"])
    assert run.first("ultrasonic", Health.FAULTY) <= 10.5

Logs are made in memory by `fusiond.simulation`, lied about by its injection, and once made kept for the session.
"""

from __future__ import annotations

import copy
import functools
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.assembly import Assembly, assemble
from fusiond.config import Config
from fusiond.demo.injecting import inject_into
from fusiond.engine.engine import Engine
from fusiond.engine.layout import Layout
from fusiond.simulation.registry import simulate
from fusiond.simulation.tables import Simulation
from fusiond.types import NANOSECONDS, Health, Kind, ServiceHealth, nanoseconds
from tools.pages.trials import CONFIGS, errors, records

Records = NDArray[Any]
Change = Callable[[Records, Layout], Records]
PROMISE_S = 36_000.0


@dataclass(frozen=True, slots=True)
class Turn:
    """A sensor's health from a time on, with what was said to be wrong with it."""

    at_s: float
    health: Health
    kind: Kind
    size: float
    std: float
    onset_s: float


@dataclass(frozen=True, slots=True)
class Run:
    """What the engine made of one log.

    Args:
        reports: (k,) of `layout.report`.   error: (k, n) estimate minus truth, NaN where there is none.
        state: sha256 of the track at the end.
    """

    layout: Layout
    reports: Records
    error: NDArray[np.float64]
    state: str

    @property
    def t_s(self) -> NDArray[np.float64]:
        """(k,) stamps in seconds."""
        return np.asarray(self.reports["t_ns"] / NANOSECONDS)

    def health(self, sensor: str) -> NDArray[np.int32]:
        """(k,) the sensor's health after every reading."""
        return np.asarray(self.reports["health"][:, self.layout.numbers[sensor]])

    def turns(self, sensor: str) -> list[Turn]:
        """Every change of the sensor's health or of the kind of its fault; it starts healthy."""
        number = self.layout.numbers[sensor]
        said = np.column_stack((self.reports["health"][:, number], self.reports["fault"][:, number]))
        before = np.vstack((np.zeros((1, 2), said.dtype), said[:-1]))
        return [self._turn(int(row), number) for row in np.flatnonzero((said != before).any(axis=1))]

    def _turn(self, row: int, number: int) -> Turn:
        report = self.reports[row]
        return Turn(
            float(report["t_ns"]) / NANOSECONDS,
            Health(int(report["health"][number])),
            Kind(int(report["fault"][number])),
            float(report["fault_size"][number]),
            float(report["fault_std"][number]),
            float(report["fault_onset_ns"][number]) / NANOSECONDS,
        )

    def named(self, sensor: str) -> Turn:
        """The first verdict on the sensor: faulty, excluded or silent."""
        for turn in self.turns(sensor):
            if turn.health in (Health.FAULTY, Health.EXCLUDED, Health.SILENT):
                return turn
        raise AssertionError(f"{sensor}: never named; {self.story()}")

    def blamed(self, sensor: str) -> bool:
        """Whether a verdict on the sensor was ever given."""
        guilty = (Health.FAULTY, Health.EXCLUDED, Health.SILENT)
        return any(turn.health in guilty for turn in self.turns(sensor))

    def last(self, sensor: str) -> Turn:
        """What is known of the sensor at the end."""
        return self._turn(len(self.reports) - 1, self.layout.numbers[sensor])

    def when(self, sensor: str, health: Health, after_s: float = 0.0) -> float:
        """When the sensor first had this health, from a time on; infinite where it never did."""
        rows = np.flatnonzero((self.health(sensor) == health) & (self.t_s >= after_s))
        return float(self.t_s[rows[0]]) if rows.size else np.inf

    def service(self, after_s: float = 0.0, before_s: float = np.inf) -> set[ServiceHealth]:
        """Every health the whole estimate had in an interval."""
        rows = (self.t_s >= after_s) & (self.t_s < before_s)
        return {ServiceHealth(int(value)) for value in np.unique(self.reports["service"][rows])}

    def worst(self, state: str, after_s: float = 0.0, before_s: float = np.inf) -> float:
        """Largest error of a state in an interval, in its unit."""
        rows = (self.t_s >= after_s) & (self.t_s < before_s)
        return float(np.max(np.abs(self.error[rows, self._column(state)])))

    def rmse(self, state: str, after_s: float = 0.0, before_s: float = np.inf) -> float:
        """Root mean square error of a state in an interval, in its unit."""
        rows = (self.t_s >= after_s) & (self.t_s < before_s)
        return float(np.sqrt(np.mean(self.error[rows, self._column(state)] ** 2)))

    def value(self, state: str) -> NDArray[np.float64]:
        """(k,) the estimate of a state."""
        return np.asarray(self.reports["x"][:, self._column(state)])

    def story(self) -> str:
        """Every turn of every sensor, for the message of a failing test."""
        lines = [
            f"{turn.at_s:.3f} {sensor.name} {turn.health.label} {turn.kind.label} {turn.size:.4g}+-{turn.std:.2g} "
            f"since {turn.onset_s:.3f}"
            for sensor in self.layout.sensors
            for turn in self.turns(sensor.name)
        ]
        return "; ".join(lines) or "nobody was ever blamed"

    def _column(self, state: str) -> int:
        return [slot.name for slot in self.layout.states].index(state)


@dataclass(frozen=True)
class Scene:
    """One configuration, its engine, and the system its sensors watch."""

    assembly: Assembly
    engine: Engine
    system: str
    options: tuple[tuple[str, Any], ...] = ()

    @property
    def layout(self) -> Layout:
        """What its records mean."""
        return self.assembly.layout

    def simulation(self, seconds: float, seed: int) -> Simulation:
        """The honest run."""
        return simulated(self.system, seconds, seed, self.options)

    def log(
        self, seconds: float, inject: Sequence[str] = (), seed: int = 0, change: Change | None = None
    ) -> Records:
        """Readings in order of arrival, lied about, then changed by the test itself."""
        clean = self.clean(seconds, seed)
        sent = [chunk.copy() for chunk in inject_into([clean], self.assembly, inject, seed)]
        log = sent[0] if inject else clean.copy()
        return log if change is None else change(log, self.layout)

    def clean(self, seconds: float, seed: int) -> Records:
        """Honest readings in the engine's own order: time, inputs first, sensor."""
        given = records(self.layout, self.simulation(seconds, seed).readings)
        return given[np.lexsort((given["sensor"], given["t_ns"]))]

    def drive(
        self, seconds: float, inject: Sequence[str] = (), seed: int = 0, change: Change | None = None
    ) -> Run:
        """Run the log from a fresh state."""
        return self.run(self.log(seconds, inject, seed, change), self.simulation(seconds, seed))

    def run(self, log: Records, simulation: Simulation) -> Run:
        """Run readings from a fresh state."""
        self.engine.reset()
        reports = self.engine.process(log).copy()
        error = errors(self.layout, reports, simulation)
        return Run(self.layout, reports, error, self.engine.state_sha256())


@functools.cache
def simulated(system: str, seconds: float, seed: int, options: tuple[tuple[str, Any], ...]) -> Simulation:
    """Simulate once a session."""
    return simulate(system, seed, seconds, **dict(options))


def _table(name: str) -> dict[str, Any]:
    return tomllib.loads((CONFIGS / f"{name}.toml").read_text(encoding="utf-8"))


def _positions(count: int) -> dict[str, Any]:
    """The constant-velocity plant with so many sensors of its position."""
    table = _table("constant_velocity")
    for k in range(2, count + 1):
        table["sensor"][f"y{k}"] = copy.deepcopy(table["sensor"]["y1"])
    return table


def _held_position() -> dict[str, Any]:
    """Three sensors of one position, of which the third repeats its last value until it has a new one."""
    table = _positions(3)
    table["sensor"]["y3"]["repeats"] = "held"
    return table


def _compensated_position() -> dict[str, Any]:
    """Three sensors of one position, of which the first is to be used with its error taken off."""
    table = _positions(3)
    table["sensor"]["y1"]["policy"] = "compensate"
    return table


def _drive_in_the_plane() -> dict[str, Any]:
    """GPS, wheel speed and gyro of the planar vehicle."""
    table = _table("planar")
    table["sensor"] = {name: table["sensor"][name] for name in ("gps", "wheel_speed", "gyro")}
    return table


def _smooth_drive() -> dict[str, Any]:
    """The same for a vehicle that moves as vehicles do, so that its model must allow for more."""
    table = _drive_in_the_plane()
    table["model"]["acceleration_noise_m_s2_sqrt_hz"] = 1.0
    table["model"]["yaw_acceleration_noise_rad_s2_sqrt_hz"] = 0.14
    return table


@dataclass(frozen=True, slots=True)
class Plan:
    """How a scene is made."""

    table: Callable[[], dict[str, Any]]
    system: str
    options: tuple[tuple[str, Any], ...] = ()


PLANS: Mapping[str, Plan] = {
    "minicar": Plan(lambda: _table("minicar"), "minicar"),
    "reference_plant": Plan(lambda: _table("reference_plant"), "reference_plant"),
    "one_position": Plan(lambda: _positions(1), "constant_velocity", (("R", (0.01,)),)),
    "two_positions": Plan(lambda: _positions(2), "constant_velocity", (("R", (0.01, 0.01)),)),
    "three_positions": Plan(lambda: _positions(3), "constant_velocity", (("R", (0.01, 0.01, 0.01)),)),
    "held_position": Plan(_held_position, "constant_velocity", (("R", (0.01, 0.01, 0.01)),)),
    "compensated_position": Plan(_compensated_position, "constant_velocity", (("R", (0.01, 0.01, 0.01)),)),
    "plane": Plan(_drive_in_the_plane, "planar", (("aboard", ("gps", "wheel_speed", "gyro")),)),
    "smooth_plane": Plan(
        _smooth_drive, "planar", (("aboard", ("gps", "wheel_speed", "gyro")), ("motion", "smooth"))
    ),
}


@functools.cache
def scene(name: str) -> Scene:
    """A configuration with fault detection, compiled once a session."""
    plan = PLANS[name]
    table = plan.table()
    table["faults"] = {"mean_time_between_false_alarms_s": PROMISE_S}
    assembly = assemble(Config.model_validate(table), CONFIGS)
    return Scene(assembly, assembly.engine(), plan.system, plan.options)


def lasting(seconds: float) -> int:
    """Nanoseconds, for tests that change stamps."""
    return nanoseconds(seconds)
