"""Seed 004's recursions and fusion modes, measured through replay: one configuration key each, the same readings.

Covariances of a linear filter do not depend on what was read, so that one run gives the stationary figures; errors
against the simulated truth are averaged over time and seeds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fusiond.assembly.assembly import Assembly
from fusiond.engine.engine import Engine
from fusiond.recording.replay import replay
from fusiond.recording.summary import Summary
from fusiond.recording.truth import Truth
from fusiond.simulation.linear_plants import ReferencePlant
from fusiond.simulation.registry import simulate
from tools.pages.trials import Floats, configured, records

Q = 2.3
PRIOR = (np.outer(ReferencePlant().B, ReferencePlant().B) * Q).tolist()
"""B Q B' (2-1): the seed's first prior, of rank 1."""
EXACT = ("centralized", "stacked", "information", "federated_reset", "information_sum")
CAUTIOUS = ("federated", "covariance_intersection", "seed_averaged")


def plant(
    R: Sequence[float], *, recursion: str = "ud", topology: str = "centralized", **said: Any
) -> Assembly:
    """configs/reference_plant.toml with one sensor for each R, started at the seed's singular prior.

    Args:
        said: further settings of [filter].
    """
    sensor = {"kind": "linear", "H": [[1.0, 0.0, 0.0]], "channels": ["y"], "rate_hz": 1.0}
    sensors: dict[str, Any] = {
        f"y{i}": {**sensor, "noise_std": {"y": float(np.sqrt(r))}} for i, r in enumerate(R, start=1)
    }
    if len(R) == 1:
        sensors["y2"] = None
    choices: Mapping[str, Any] = {
        "model": {"Q": [[Q]]},
        "sensor": sensors,
        "initial": {"std": None, "covariance": PRIOR},
        "filter": {"recursion": recursion, "leave_one_out": False, "local_filters": False, **said},
        "fusion": {"topology": topology},
    }
    return configured("reference_plant", choices)


@dataclass(frozen=True, slots=True)
class Replayed:
    """One replay: the engine as it ended, its summary, and the covariance (k, n, n) after each reading."""

    engine: Engine
    summary: Summary
    P: Floats


def replayed(assembly: Assembly, R: Sequence[float], steps: int = 150, seed: int = 0) -> Replayed:
    """Replay a simulated log of the reference plant through a fresh engine."""
    simulation = simulate("reference_plant", seed, float(steps), Q=Q, R=tuple(R))
    engine = assembly.engine()
    given = records(engine.layout, simulation.readings)
    given = given[np.lexsort((given["sensor"], given["t_ns"]))]
    true = simulation.truth
    truth = Truth(true.t_ns, true.names, true.values, np.zeros(len(true.names), dtype=np.bool_))
    summary = replay(engine, [given], truth=truth)
    return Replayed(engine, summary, engine.covariances[: len(given)].copy())


@dataclass(frozen=True, slots=True)
class Ratios:
    """Traces of stationary covariances: reported by the mode, true (None where unknown to it), optimal."""

    reported: float
    true: float | None
    optimal: float


def ratios(topology: str, R: Sequence[float], steps: int = 150) -> Ratios:
    """One topology beside the stacked filter, which is the optimum (tests/laws/test_fusion_exact.py)."""
    optimal = np.trace(replayed(plant(R, topology="stacked"), R, steps).engine.covariance())
    engine = replayed(plant(R, topology=topology), R, steps).engine
    honest = engine.honest_covariance()
    true = None if honest is None else float(np.trace(honest))
    return Ratios(float(np.trace(engine.covariance())), true, float(optimal))


@dataclass(frozen=True, slots=True)
class Start:
    """A recursion from the singular start, against Model 1: largest |P - P_exact| over the run, and its repairs."""

    error: float
    repairs: int
    unsound: int


def singular_start(recursion: str, steps: int = 60, **said: Any) -> Start:
    """One sensor, R = 1, from B Q B'."""
    exact = replayed(plant((1.0,), recursion="conventional"), (1.0,), steps)
    run = replayed(plant((1.0,), recursion=recursion, **said), (1.0,), steps)
    guard = run.engine.guard()
    return Start(float(np.abs(run.P - exact.P).max()), run.summary.repairs, int(guard.get("unsound", 0)))
