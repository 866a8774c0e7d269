"""What goes wrong in a run, drawn at random: a sensor that lies, and a stream in disorder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.simulation.faults import SIZES, Fault, Kind
from fusiond.types import nanoseconds

FIRST, LAST = 0.2, 0.5
"""A fault begins in this part of the run,"""
SHORTEST, LONGEST = 0.02, 0.1
"""and lasts for this part of it, so that there is time to recover."""
LOST = REPEATED = GARBLED = 0.02
"""Share of the readings that a disorder of its kind meets."""
LATE_PERIODS = 3.0
"""So many periods of the slowest sensor a reading may be under way."""
DISORDERS = ("none", "lost", "repeated", "late", "garbled")


@dataclass(frozen=True, slots=True)
class Mischief:
    """Faults that overlap or not, each of another sensor, and one kind of disorder."""

    faults: tuple[Fault, ...]
    disorder: str

    @property
    def liars(self) -> set[str]:
        """Whoever lies at some time."""
        return {fault.sensor for fault in self.faults}

    def __str__(self) -> str:
        return " ".join([*map(str, self.faults), f"({self.disorder} readings)" * (self.disorder != "none")])


def drawn(rng: np.random.Generator, sigma: Mapping[str, float], seconds: float) -> Mischief:
    """One to two faults of sensors with such noise, in a run of that length."""
    count = min(int(rng.integers(1, 3)), len(sigma))
    liars = rng.choice(sorted(sigma), count, replace=False)
    faults = tuple(_fault(rng, str(liar), sigma[str(liar)], seconds) for liar in liars)
    return Mischief(faults, str(rng.choice(DISORDERS)))


def _fault(rng: np.random.Generator, sensor: str, sigma: float, seconds: float) -> Fault:
    """One fault of any kind; sigma: deviation of the sensor's noise, in its unit."""
    kind = Kind(rng.choice(list(Kind)))
    start_s, lasting_s = seconds * rng.uniform(FIRST, LAST), seconds * rng.uniform(SHORTEST, LONGEST)
    size = float(f"{_size(rng, kind, sigma, lasting_s):.4g}") if kind in SIZES else 0.0
    return Fault(
        sensor=sensor,
        kind=kind,
        start_ns=nanoseconds(round(start_s, 3)),
        size=size,
        duration_ns=nanoseconds(max(round(lasting_s, 3), 0.001)),
    )


def _size(rng: np.random.Generator, kind: Kind, sigma: float, lasting_s: float) -> float:
    """From what nobody can see to what nobody can miss."""
    large = float(sigma * rng.choice((-1.0, 1.0)) * 10.0 ** rng.uniform(0.0, 3.0))
    sizes = {
        Kind.DELAY: rng.uniform(0.01, 0.5),
        Kind.SCALE: rng.uniform(0.5, 1.5),
        Kind.DRIFT: large / lasting_s,
        Kind.NOISE: 10.0 ** rng.uniform(0.2, 2.0),
        Kind.INTERMITTENT: rng.uniform(0.0, 0.9),
    }
    return float(sizes.get(kind, large))


def lateness_s(mischief: Mischief, slowest_hz: float) -> float:
    """How long a reading may be under way."""
    return LATE_PERIODS / slowest_hz if mischief.disorder == "late" else 0.0


def disordered(rng: np.random.Generator, log: NDArray[Any], disorder: str) -> NDArray[Any]:
    """The readings as they come through: some lost, told twice, or with numbers that are none."""
    if disorder == "lost":
        return log[rng.random(log.size) >= LOST]
    if disorder == "repeated":
        return np.repeat(log, 1 + (rng.random(log.size) < REPEATED))
    if disorder == "garbled":
        log = log.copy()
        rows = np.flatnonzero(rng.random(log.size) < GARBLED)
        log["z"][rows, 0] = rng.choice((np.nan, np.inf, -np.inf, 1e300, -1e300), rows.size)
    return log
