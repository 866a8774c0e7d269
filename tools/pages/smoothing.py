"""Runs and their smoothed states: of one log, and of many simulated ones judged against their truth."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from fusiond.assembly.assembly import Assembly
from fusiond.assembly.retracing import injection_of, tracer_of
from fusiond.assembly.trial import Trial
from fusiond.recording.smoothing import Smoother
from fusiond.recording.smoothing_order import PIECE, pieces
from fusiond.simulation.tables import Simulation
from tools.pages.consistency import Case, Check
from tools.pages.trials import Floats, Records, configured, merged, records

SHARE = 0.998
"""Of consistent runs, how many a band holds: five systems are all inside 99 times of a hundred."""
ONE_FILTER = {"filter": {"leave_one_out": False, "local_filters": False}}


@dataclass(frozen=True, slots=True)
class Smoothed:
    """One run: filtered and smoothed states after each update, in the order of time.

    Args:
        filtered: records of the retraced run (`pass_dtype`).   states: of `smoothed_dtype`.
        segments: parts smoothed by themselves.   followed: the retraced run ended in the engine's own bits.
    """

    filtered: Records
    states: Records
    segments: int
    followed: bool

    @property
    def filtered_P(self) -> Floats:
        """(k, n, n) the filter's own covariances."""
        U = np.triu(self.filtered["U"], 1) + np.eye(self.filtered["d"].shape[1])
        return np.asarray((U * self.filtered["d"][:, None, :]) @ np.swapaxes(U, 1, 2))


def smoothed_run(assembly: Assembly, readings: Records, chunk: int = PIECE) -> Smoothed:
    """Readings in arrival order through a fresh engine, watched and smoothed."""
    engine = assembly.engine()
    smoother = Smoother(tracer_of(assembly), assembly.design, injection_of(assembly), engine.track)
    try:
        for part in pieces([readings], chunk):
            smoother.witness(part, engine.process(part))
        followed = smoother.finish()
        filtered = np.concatenate([block.copy() for block in smoother.filtered()])
        states = np.concatenate([block.copy() for block in smoother.smoothed()])
        return Smoothed(filtered, states, smoother.segments, followed)
    finally:
        smoother.close()


def truth_at(assembly: Assembly, simulation: Simulation, t_ns: NDArray[np.int64]) -> Floats:
    """(k, states) what was so at these times; NaN for a state that the truth does not have."""
    truth = simulation.truth
    known = [
        np.interp(t_ns, truth.t_ns, truth.column(slot.name))
        if slot.name in truth.names
        else np.full(len(t_ns), np.nan)
        for slot in assembly.layout.states
    ]
    return np.column_stack(known)


def apart(trial: Trial, x: Floats, truth: Floats) -> Floats:
    """(k, errors) what leads from the estimates to the truth."""
    return np.array([trial.error(one, true) for one, true in zip(x, truth, strict=True)])


def band(nees: Floats, n: int) -> Check:
    """Mean of independent NEES, each of n degrees of freedom, in its two-sided band."""
    degrees = n * nees.size
    low, high = (float(chi2.ppf(0.5 + sign * SHARE / 2.0, degrees)) / nees.size for sign in (-1.0, 1.0))
    return Check(float(nees.mean()), low, high)


@dataclass(frozen=True, slots=True)
class Gain:
    """What smoothing many runs of one system comes to.

    Args:
        ratio: (n,) RMSE of the smoothed over that of the filtered, by error, over all updates of all runs.
        nees: mean NEES of the smoothed at the middle of each run, with its band.
        filter_nees: the filter's, at the same moments.   runs: how many.
    """

    ratio: Floats
    nees: Check
    filter_nees: Check
    runs: int


def gain_of(assembly: Assembly, runs: Iterable[tuple[Records, Any]]) -> Gain:
    """Smooth runs of one configuration.

    Args:
        runs: readings in arrival order, and what gives the truth (k, states) at times (k,) ns.
    """
    trial, n = Trial(assembly.resolved), assembly.layout.shape.errors
    squares, nees = np.zeros((2, n)), np.zeros((2, 0))
    for readings, truth in runs:
        run = smoothed_run(assembly, readings)
        true = truth(run.states["state_t_ns"])
        middle, both = len(true) // 2, []
        for row, (x, P) in enumerate(
            ((run.filtered["x"], run.filtered_P), (run.states["x"], run.states["P"]))
        ):
            error = apart(trial, x, true)
            squares[row] += np.sum(error**2, axis=0)
            both.append(error[middle] @ np.linalg.solve(P[middle], error[middle]))
        nees = np.column_stack([nees, both])
    return Gain(np.sqrt(squares[1] / squares[0]), band(nees[1], n), band(nees[0], n), nees.shape[1])


def gain_on(case: Case, simulations: Iterable[Simulation]) -> tuple[Assembly, Gain]:
    """Smooth simulated logs of a case, with its configuration."""
    assembly = configured(case.config or case.name, merged(case.changes, ONE_FILTER))

    def run(simulation: Simulation) -> tuple[Records, Any]:
        given = records(assembly.layout, [*case.first, *simulation.readings])
        given = given[np.lexsort((given["sensor"], given["t_ns"]))]
        return given, lambda t_ns: truth_at(assembly, simulation, t_ns)

    return assembly, gain_of(assembly, map(run, simulations))
