"""The posterior Cramer-Rao bound of seed 003's filter on its own model, and how near the filter comes to it.

Runs are drawn from the model of the configuration: its prior, its disturbances, its noises. The bound along a run is
the covariance recursion linearised at the truth, P- = F P F' + Q, P = (I + P- H' R^-1 H)^-1 P- (Tichavsky 1998, written
so that a singular Q does no harm), averaged over runs. A filter that linearises at the truth attains it; nobody can run
that one, but its errors on the same draws are known, and against them the luck of the draw falls out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fusiond.assembly.assembly import Assembly
from fusiond.assembly.trial import Trial
from fusiond.engine.engine import Engine
from fusiond.models.slipping_robot import ACCELERATION_BIAS
from fusiond.numerics.kernel import interpreted
from fusiond.simulation.square_robot import SAMPLE_NS, SAMPLED, Pace, motion
from fusiond.simulation.streams import stream
from fusiond.simulation.tables import Floats, Reading
from tools.pages.trials import records

DT_S = SAMPLE_NS * 1e-9
DURATION_NS = 22_000_000_000


@dataclass(frozen=True, slots=True)
class Draw:
    """One run of the filter's own model, a row every 10 ms from the second on.

    states: (k, n + 1) the truth.   bound: (k, n) variances.   best: (k, n) errors of the filter that linearises at the
    truth.
    """

    states: Floats
    bound: Floats
    best: Floats
    readings: list[Reading]


class OwnModel:
    """The model of a configuration with the square's accelerations, to draw from."""

    def __init__(self, assembly: Assembly) -> None:
        self.resolved = assembly.resolved
        self.trial = Trial(assembly.resolved)
        self.sensors = {sensor.name: sensor for sensor in assembly.resolved.sensors}
        self.std = np.sqrt(assembly.design[0]["d0"])
        speed = motion(Pace(), DURATION_NS).speed_m_s[SAMPLED]
        self.gained = np.diff(speed, prepend=0.0) / DT_S

    def draw(self, seed: int) -> Draw:
        """One run, its bound, and the errors that attain it."""
        rng, n = stream(seed, "own model"), self.std.size
        error, P = self.std * rng.standard_normal(n), np.diag(self.std**2)
        x = self.trial.shift(self.trial.initial(), error)
        readings: list[Reading] = []
        rows: list[tuple[Floats, Floats, Floats]] = []
        input_std = float(np.sqrt(self.sensors["accelerometer"].R[0, 0]))
        for k, gained in enumerate(self.gained.tolist()):
            if k:
                felt = input_std * rng.standard_normal(1)
                u = gained + x[ACCELERATION_BIAS] + felt
                x, F, G, Q = self._step(x, u, felt, rng)
                error, P = F @ error + G, F @ P @ F.T + Q
                readings.append(Reading(k * SAMPLE_NS, "accelerometer", (float(u[0]),)))
            for sensor in self.resolved.updating:
                h, H = self.trial.look(sensor, x)
                v = np.sqrt(np.diag(sensor.R)) * rng.standard_normal(h.size)
                K = P @ H.T @ np.linalg.inv(H @ P @ H.T + sensor.R)
                error, P = error - K @ (H @ error + v), P - K @ H @ P
                P = 0.5 * (P + P.T)
                readings.append(Reading(k * SAMPLE_NS, sensor.name, tuple((h + v).tolist())))
            rows.append((x, np.diag(P).copy(), -error))
        states, bound, best = (np.array(column[1:]) for column in zip(*rows, strict=True))
        return Draw(states, bound, best, readings)

    def _step(self, x: Floats, u: Floats, felt: Floats, rng: Any) -> tuple[Floats, Floats, Floats, Floats]:
        """x 10 ms later, F, what the disturbances add to the error, Q."""
        process, module, p = self.resolved.process, self.resolved.process_module, self.trial.parameters()
        n = self.std.size
        G, q = np.zeros((n, process.noises)), np.zeros(process.noises)
        interpreted(module.noise)(x, DT_S, p, G, q)
        moved, F, B = self.trial.move(x, u, DT_S)
        disturbed = G @ (np.sqrt(q) * rng.standard_normal(q.size)) - B @ felt
        Q = (G * q) @ G.T + (B * self.sensors["accelerometer"].R[0, 0]) @ B.T
        return self.trial.shift(moved, disturbed), F, disturbed, Q


@dataclass(frozen=True, slots=True)
class Score:
    """How near the filter comes to the bound, error by error, all runs and moments together.

    ratio: RMSE over bound.   ratio_std: its standard error, from the scatter of the runs.
    paired: RMSE over that of the filter linearised at the truth, on the same draws.   nees: (runs,) at the end.
    """

    names: tuple[str, ...]
    ratio: Floats
    ratio_std: Floats
    paired: Floats
    nees: Floats

    def of(self, name: str) -> float:
        """RMSE / bound of one state, the luck of the draw taken out."""
        return float(self.paired[self.names.index(name)])


def score(assembly: Assembly, engine: Engine, runs: int, seed: int = 0) -> Score:
    """Draw runs, filter them, compare. The engine may be another's than the assembly's: a wrong filter's, to see it."""
    own = OwnModel(assembly)
    squares, best, bounds, nees = [], [], [], []
    for k in range(runs):
        draw = own.draw(seed + k)
        engine.reset()
        given = records(engine.layout, draw.readings)
        given = given[np.lexsort((given["sensor"], given["t_ns"]))]
        reports = engine.process(given, covariances=True)
        last = np.flatnonzero(np.append(np.diff(reports["t_ns"]) != 0, True))[1:]
        wrong = np.array(
            [own.trial.error(x, y) for x, y in zip(draw.states, reports["x"][last], strict=True)]
        )
        squares.append(np.mean(wrong**2, axis=0))
        best.append(np.mean(draw.best**2, axis=0))
        bounds.append(np.mean(draw.bound, axis=0))
        nees.append(float(wrong[-1] @ np.linalg.solve(engine.covariances[last[-1]], wrong[-1])))
    mean = np.mean(squares, axis=0)
    ratio = np.sqrt(mean / np.mean(bounds, axis=0))
    spread = np.std(squares, axis=0, ddof=1) / np.sqrt(runs) / mean
    names = tuple(slot.name for slot in assembly.layout.errors)
    return Score(names, ratio, 0.5 * ratio * spread, np.sqrt(mean / np.mean(best, axis=0)), np.array(nees))
