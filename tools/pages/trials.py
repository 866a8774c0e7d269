"""Simulated systems through the engine: one log as a batch, or a plant whose force is the engine's own command."""

from __future__ import annotations

import copy
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.assembly import Assembly, assemble
from fusiond.config import Config
from fusiond.engine.engine import Engine
from fusiond.engine.layout import Layout
from fusiond.simulation.closed_loop import LoopRun
from fusiond.simulation.rig import STEP_NS, PointRig
from fusiond.simulation.tables import Reading, Simulation

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
Floats = NDArray[np.float64]
Records = NDArray[Any]


def merged(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """`base` with `changes` put in, table by table; None removes a key."""
    result = copy.deepcopy(dict(base))
    for key, value in changes.items():
        if value is None:
            result.pop(key, None)
        elif isinstance(value, Mapping) and isinstance(result.get(key), Mapping):
            result[key] = merged(result[key], value)
        else:
            result[key] = copy.deepcopy(value)
    return result


def configured(name: str, changes: Mapping[str, Any] | None = None) -> Assembly:
    """configs/NAME.toml assembled, with changes by section: {"model": {"bias": False}}; raises ConfigError.

    Without its section `faults`, unless `changes` has one: what is measured is the filter, on sensors that do not lie.
    """
    text = (CONFIGS / f"{name}.toml").read_text(encoding="utf-8")
    return assemble(
        Config.model_validate(merged(tomllib.loads(text), {"faults": None, **(changes or {})})), CONFIGS
    )


def records(layout: Layout, readings: Iterable[Reading]) -> Records:
    """(k,) records of `layout.reading` in the order given; a sensor the layout does not have is left out."""
    known = layout.numbers
    kept = [reading for reading in readings if reading.sensor in known]
    filled = np.zeros(len(kept), layout.reading)
    filled["t_ns"] = [reading.t_ns for reading in kept]
    filled["sensor"] = [known[reading.sensor] for reading in kept]
    filled["length"] = [len(reading.z) for reading in kept]
    for sensor in layout.sensors:
        rows = np.flatnonzero(filled["sensor"] == sensor.number)
        if rows.size:
            filled["z"][rows, : len(sensor.channels)] = [kept[row].z for row in rows.tolist()]
    return filled


@dataclass(frozen=True, slots=True)
class Trial:
    """What the engine made of one log: a row for each reading.

    reports: (k,) of `layout.report`.   P: (k, n, n) centralized covariance after each reading.
    error: (k, n) estimate minus truth, angles on the circle, NaN for a state that the truth does not have.
    """

    layout: Layout
    reports: Records
    P: Floats
    error: Floats

    def last_of_each_stamp(self) -> NDArray[np.int64]:
        """(stamps,) the row after which everything of its stamp is in the estimate."""
        t_ns = self.reports["t_ns"]
        return np.flatnonzero(np.append(t_ns[1:] != t_ns[:-1], True))

    def nees(self, rows: NDArray[np.int64]) -> Floats:
        """(rows,) e' P^-1 e, chi-square with n degrees of freedom where the filter is consistent."""
        error = self.error[rows]
        solved = np.linalg.solve(self.P[rows], error[:, :, None])[:, :, 0]
        return np.asarray(np.sum(error * solved, axis=1))

    def of(self, sensor: str) -> NDArray[np.int64]:
        """(k,) rows of one sensor's readings; raises KeyError where there is none of that name."""
        return np.flatnonzero(self.reports["sensor"] == self.layout.numbers[sensor])


def errors(layout: Layout, reports: Records, simulation: Simulation) -> Floats:
    """(k, n) estimate minus truth, interpolated to each report's own time."""
    truth = simulation.truth
    error = np.full((reports.shape[0], len(layout.states)), np.nan)
    for column, slot in enumerate(layout.states):
        if slot.name in truth.names:
            exact = np.interp(reports["t_ns"], truth.t_ns, truth.column(slot.name))
            error[:, column] = reports["x"][:, column] - exact
            if slot.unit == "rad":
                error[:, column] = (error[:, column] + np.pi) % (2.0 * np.pi) - np.pi
    return error


def estimate(engine: Engine, simulation: Simulation, first: Sequence[Reading] = ()) -> Trial:
    """Run one simulated log through a fresh state of the engine; `first` comes before it.

    The readings come in the engine's own order (time, inputs first, name): where the input of an interval arrives
    after a reading at its end, the report on that reading knows the interval only as it was before.
    """
    engine.reset()
    given = records(engine.layout, [*first, *simulation.readings])
    given = given[np.lexsort((given["sensor"], given["t_ns"]))]
    reports = engine.process(given, covariances=True).copy()
    P = engine.covariances[: given.shape[0]].copy()
    return Trial(engine.layout, reports, P, errors(engine.layout, reports, simulation))


@dataclass(frozen=True, slots=True)
class Steered:
    """A plant steered by the engine, one row a millisecond: the loop, and the state and std (n,) it was fed."""

    loop: LoopRun
    x: Floats
    std: Floats


def steer(engine: Engine, rig: PointRig, duration_ns: int) -> Steered:
    """Close the loop: every reading goes into the engine by itself, the force is the last command that came out."""
    engine.reset()
    readings = rig.begin()
    now, force_n = readings, 0.0
    states, forces, x, std = [], [], [], []
    for step in range(duration_ns // STEP_NS + 1):
        if step:
            now = rig.advance(force_n)
            readings.extend(now)
        for given in records(engine.layout, now):
            report = engine.process(given.reshape(1))[0]
            if report["command_due"]:
                force_n = float(report["command"][0])
        states.append(rig.state)
        forces.append(force_n)
        x.append(report["x"].copy())
        std.append(report["std"].copy())
    t_ns = np.arange(len(states), dtype=np.int64) * STEP_NS
    loop = LoopRun(t_ns, np.array(states), np.array(x)[:, :2], np.array(forces), tuple(readings))
    return Steered(loop, np.array(x), np.array(std))
