"""Many runs through one engine with its judge, and what it decided in each."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fusiond.assembly.assembly import Assembly
from fusiond.engine.engine import Engine
from fusiond.types import Health, Kind
from tools.scoreboard.plants import Floats, Plant
from tools.scoreboard.watching import Records, readings_of

NAMED = (int(Health.FAULTY), int(Health.EXCLUDED), int(Health.PROBATION))


@dataclass(frozen=True, slots=True)
class Verdict:
    """What was decided in one run, from the onset on; sensors by their place among those with readings.

    step: of the first name given, -1 without one.   named: who was named then.   kind, onset: as told with it.
    error: of the sensor at that step by what was told, in its channel's unit: the size of a bias, the rate of a drift
        times its age; not a number for kinds that say nothing of it.
    suspects: those last told to be indistinguishable from one another.
    """

    step: int
    named: tuple[int, ...]
    kind: Kind
    error: float
    onset: int
    suspects: tuple[int, ...]


def places(assembly: Assembly, reports: Records) -> tuple[Records, list[int]]:
    """The last report of each step, and the numbers of the sensors with readings."""
    numbers = [sensor.number for sensor in assembly.layout.sensors if sensor.role.name != "INPUT"]
    t_ns = reports["t_ns"]
    return reports[np.append(t_ns[1:] != t_ns[:-1], True)], numbers


def verdict_of(assembly: Assembly, reports: Records, onset: int) -> Verdict:
    """What the reports of one run say."""
    steps, numbers = places(assembly, reports)
    health = steps["health"][:, numbers]
    told = (steps["suspects"][:, numbers] != 0) & (health == Health.SUSPECT)
    told[:onset] = False
    last = int(np.max(np.flatnonzero(told.any(axis=1)), initial=0))
    suspects = tuple(int(k) for k in np.flatnonzero(told[last]))
    named = np.isin(health[onset:], NAMED).any(axis=1)
    if not named.any():
        return Verdict(-1, (), Kind.NONE, math.nan, -1, suspects)
    at = onset + int(np.argmax(named))
    who = tuple(k for k in range(len(numbers)) if health[at, k] in NAMED)
    row, first = steps[at], numbers[who[0]]
    step_ns = int(steps["t_ns"][0])
    began = round(int(row["fault_onset_ns"][first]) / step_ns) - 1
    kind, age_s = Kind(int(row["fault"][first])), (row["t_ns"] - row["fault_onset_ns"][first]) * 1e-9
    error = float(row["fault_size"][first]) * {Kind.BIAS: 1.0, Kind.DRIFT: float(age_s)}.get(kind, math.nan)
    return Verdict(at, who, kind, error, began, suspects)


def judged(assembly: Assembly, engine: Engine, z: Floats, onset: int) -> list[Verdict]:
    """Run (runs, steps, s) readings, each run from a fresh beginning."""
    found = []
    for readings in readings_of(assembly, z):
        engine.reset()
        found.append(verdict_of(assembly, engine.process(readings), onset))
    return found


@dataclass(frozen=True, slots=True)
class Settled:
    """The settled filter of a plant whose sensors read at once: gain (n, s), inverse innovation covariance (s, s)."""

    plant: Plant
    K: Floats
    inverse: Floats

    def means(self, sensor: int, steps: int) -> Floats:
        """(steps, s) mean of the innovations while one sensor errs by one."""
        error, fault = np.zeros(len(self.plant.A)), np.eye(len(self.plant.H))[sensor]
        rows = []
        for _ in range(steps):
            rows.append(fault - self.plant.H @ error)
            error = self.plant.A @ (error + self.K @ rows[-1])
        return np.array(rows)

    def innovations(self, z: Floats) -> Floats:
        """(steps, s) of one run."""
        x, rows = np.zeros(len(self.plant.A)), []
        for reading in z:
            rows.append(reading - self.plant.H @ x)
            x = self.plant.A @ (x + self.K @ rows[-1])
        return np.array(rows)

    def information(self, sensor: int, steps: int) -> Floats:
        """(steps,) information about the size of a bias in its first 1, 2, ... steps."""
        means = self.means(sensor, steps)
        return np.asarray(np.cumsum(np.einsum("ki,ij,kj->k", means, self.inverse, means)))

    def likely_onset(self, z: Floats, sensor: int, size: float, last: int, back: int = 60) -> int:
        """The most likely onset of a bias of known size, by the readings up to step `last`."""
        nu, means = self.innovations(z[: last + 1]), size * self.means(sensor, back)
        scores = []
        for age in range(1, back + 1):
            rho = means[:age]
            tail = nu[last + 1 - age :] - 0.5 * rho
            scores.append(float(np.einsum("ki,ij,kj->", rho, self.inverse, tail)))
        return last - int(np.argmax(scores))


def settled_of(plant: Plant) -> Settled:
    """Iterate the Riccati equation until it has settled."""
    noise = (plant.G * plant.Q) @ plant.G.T
    P = np.diag(plant.start**2)
    for _ in range(2000):
        inverse = np.linalg.inv(plant.H @ P @ plant.H.T + np.diag(plant.R))
        K = P @ plant.H.T @ inverse
        P = plant.A @ (P - K @ plant.H @ P) @ plant.A.T + noise
        P = 0.5 * (P + P.T)
    return Settled(plant, K, np.asarray(inverse, dtype=np.float64))
