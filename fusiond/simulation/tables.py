"""What a simulation hands out: readings in arrival order, and the truth they were taken from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Times = NDArray[np.int64]


class Reading(NamedTuple):
    """One reading, a plain tuple: the stamp in nanoseconds, who measured, and the values in SI units."""

    t_ns: int
    sensor: str
    z: tuple[float, ...]


def stamps(duration_ns: int, period_ns: int) -> Times:
    """0, period, 2 period, ... up to and including the duration."""
    return np.arange(0, duration_ns + 1, period_ns, dtype=np.int64)


@dataclass(frozen=True, slots=True)
class Truth:
    """Named columns over time.

    t_ns: (n,) strictly increasing.   names: m column names.   values: (n, m), SI.
    Angles are unwrapped, so that a linear interpolation between two rows is right on both sides of pi.
    """

    t_ns: Times
    names: tuple[str, ...]
    values: Floats

    def column(self, name: str) -> Floats:
        """(n,) one column; raises KeyError when there is none of that name."""
        if name not in self.names:
            raise KeyError(f"{name}: no such truth column; there are {', '.join(self.names)}")
        return self.values[:, self.names.index(name)]

    def at(self, t_ns: int) -> dict[str, float]:
        """Every column interpolated linearly to one time, which must lie inside the table."""
        if not self.t_ns[0] <= t_ns <= self.t_ns[-1]:
            raise ValueError(f"{t_ns} ns lies outside the truth, {self.t_ns[0]} to {self.t_ns[-1]} ns")
        return {name: float(np.interp(t_ns, self.t_ns, self.column(name))) for name in self.names}


@dataclass(frozen=True, slots=True)
class Simulation:
    """One seeded run. `arrivals_ns[i]` is when `readings[i]` arrives: at its stamp, unless delayed."""

    name: str
    seed: int
    readings: tuple[Reading, ...]
    arrivals_ns: Times
    truth: Truth

    def of(self, sensor: str) -> tuple[Times, Floats]:
        """Stamps (n,) and values (n, channels) of one sensor, in arrival order."""
        mine = [reading for reading in self.readings if reading.sensor == sensor]
        return (
            np.array([reading.t_ns for reading in mine], dtype=np.int64),
            np.array([reading.z for reading in mine], dtype=np.float64),
        )
