"""Seed 002's filter on drives: every sensor's readings through the engine, and its errors against the truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fusiond.assembly.assembly import Assembly
from fusiond.engine.engine import Engine
from fusiond.simulation.streams import stream
from fusiond.simulation.tables import Floats, Reading
from fusiond.simulation.vehicle_equations import Car, Disturbance, drive
from fusiond.simulation.vehicle_sensors import MILLISECOND_NS, Motion, wrapped
from tools.pages.trials import records

DT_S = MILLISECOND_NS * 1e-9
YAW = 5
SEED_STATES = 8
"""The seed's own; behind them stand the two specific forces."""


@dataclass(frozen=True, slots=True)
class Drive:
    """The filter on one drive, a row a millisecond from the second on.

    error: (n, 10) estimate minus truth.   P: (n, 10, 10) the filter's own covariance.
    """

    t_s: Floats
    error: Floats
    P: Floats

    def nees(self, row: int) -> float:
        """e' P^-1 e over the seed's eight states, chi-square with 8 degrees of freedom where consistent."""
        e = self.error[row, :SEED_STATES]
        return float(e @ np.linalg.solve(self.P[row, :SEED_STATES, :SEED_STATES], e))


def follow(engine: Engine, motion: Motion, given: list[Reading]) -> Drive:
    """Run one drive's readings through a fresh state of the engine."""
    engine.reset()
    batch = records(engine.layout, given)
    batch = batch[np.lexsort((batch["sensor"], batch["t_ns"]))]
    reports = engine.process(batch, covariances=True)
    t_ns = reports["t_ns"]
    last = np.flatnonzero(np.append(t_ns[1:] != t_ns[:-1], True))[1:]
    rows = (t_ns[last] - motion.t_ns[0]) // MILLISECOND_NS
    error = reports["x"][last] - motion.states[rows]
    error[:, YAW] = wrapped(error[:, YAW])
    return Drive(t_ns[last] / 1e9, error, engine.covariances[last].copy())


def own_equations(motion: Motion, assembly: Assembly) -> Motion:
    """The same drive by the filter's own equations: the axle forces of the motion imposed, nothing left unexplained."""
    forces = np.vstack((motion.states[1:, 3:5], motion.states[-1:, 3:5]))
    states = drive(
        car_of(model_of(assembly)),
        Disturbance(0.0, 0.0, 0.0),
        motion.states[:1, :8],
        motion.drive_n[:-1],
        motion.steering_rad[:-1],
        forces,
        DT_S,
        stream(0, "unused"),
    )
    return Motion(motion.t_ns, states[:, 0], motion.drive_n, motion.steering_rad)


def model_of(assembly: Assembly) -> dict[str, Any]:
    """The numbers of a configuration's model, by name."""
    return dict(assembly.config.model)


def car_of(model: Mapping[str, Any]) -> Car:
    """The plant with the numbers of a configuration's model."""
    names = ("mass_kg", "yaw_inertia_kg_m2", "front_m", "rear_m", "track_m", "drag_area_m2")
    return Car(**{name: model[name] for name in names})


def withheld(given: list[Reading], sensors: tuple[str, ...], from_s: float, to_s: float) -> list[Reading]:
    """The readings without those of some sensors in [from, to)."""
    return [
        reading
        for reading in given
        if reading.sensor not in sensors or not from_s <= reading.t_ns * 1e-9 < to_s
    ]
