"""What each kind of fault does to the readings of one sensor.

    delay         z(t) carries the value of t - SIZE, linear between the readings that came (in `faults_injection`)
    scale         SIZE z
    bias, drift   z + SIZE,  z + SIZE (t - START)
    noise         z + sqrt(SIZE^2 - 1) sigma n, n ~ N(0, 1): SIZE times the sensor's own noise in all
    spike         z + SIZE for one reading, or for all of DURATION
    stuck         the last value before
    nan           not a number
    intermittent  each reading is delivered with probability SIZE
    broken        none is

Stamps, sequence numbers, covariances and the order of arrival stay as they are. Angles stay in (-pi, pi].
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fusiond.simulation.faults import Fault, Kind
from fusiond.simulation.faults_delay import wrapped
from fusiond.simulation.tables import Floats, Times
from fusiond.types import NANOSECONDS

Rows = NDArray[np.intp]


@dataclass(slots=True)
class Readings:
    """Readings of one sensor on their way out, in order of arrival.

    Args:
        z: (k, m), altered in place.      sigma: (k, m) or (m,) standard deviations of their honest noise.
        keep: (k,) whether each is delivered.
    """

    t_ns: Times
    z: Floats
    sigma: Floats
    keep: NDArray[np.bool_]

    def deviations(self, rows: Rows) -> Floats:
        """(k, m) or (m,) of these rows."""
        return self.sigma if self.sigma.ndim == 1 else self.sigma[rows]


@dataclass(slots=True)
class Effect:
    """One fault with its memory.

    Args:
        begin_ns, end_ns: on the readings' clock.      channels: where it is, of a reading's m numbers.
        angles: channels that live on a circle.      rng: its own stream.      hits: readings it has met.
    """

    fault: Fault
    begin_ns: int
    end_ns: int
    channels: slice
    angles: frozenset[int]
    rng: np.random.Generator
    hits: int = 0
    spent: bool = False
    before: Floats | None = None
    held: Floats | None = None

    def rows(self, t_ns: Times) -> Rows:
        """Which of the readings it meets; counted."""
        rows = np.flatnonzero((t_ns >= self.begin_ns) & (t_ns < self.end_ns))
        self.hits += rows.size
        return rows

    def apply(self, readings: Readings) -> None:
        """Alter what it meets."""
        rows = self.rows(readings.t_ns)
        if self.fault.kind is Kind.STUCK:
            self._remember(readings.z, rows)
        if rows.size:
            # What overflows or is no number stays what it is: the sensor lies, not we.
            with np.errstate(all="ignore"):
                ACTS[self.fault.kind](self, readings, rows)

    def _remember(self, z: Floats, rows: Rows) -> None:
        """The value before the first reading it meets; there is none before the first of the run, which then stays."""
        first = int(rows[0]) if rows.size else len(z)
        if self.held is None and rows.size:
            before = z[first - 1] if first else self.before
            self.held = z[first].copy() if before is None or len(before) != z.shape[1] else before.copy()
        if first == len(z):
            self.before = z[-1].copy()

    def move(self, readings: Readings, rows: Rows, moved: Callable[[Floats], Floats]) -> None:
        """Change the values of some rows; angles stay on their circle."""
        whole = readings.z[rows]
        whole[:, self.channels] = moved(whole[:, self.channels])
        for channel in self.angles.intersection(range(*self.channels.indices(whole.shape[1]))):
            whole[:, channel] = wrapped(whole[:, channel])
        readings.z[rows] = whole


def _scale(effect: Effect, readings: Readings, rows: Rows) -> None:
    effect.move(readings, rows, lambda z: effect.fault.size * z)


def _bias(effect: Effect, readings: Readings, rows: Rows) -> None:
    effect.move(readings, rows, lambda z: z + effect.fault.size)


def _drift(effect: Effect, readings: Readings, rows: Rows) -> None:
    since_s = (readings.t_ns[rows] - effect.begin_ns) / NANOSECONDS
    effect.move(readings, rows, lambda z: z + effect.fault.size * since_s[:, np.newaxis])


def _noise(effect: Effect, readings: Readings, rows: Rows) -> None:
    # One draw for every number of a reading, wherever the fault is: its other channels change no draw of this one.
    draws = effect.rng.standard_normal((rows.size, readings.z.shape[1]))
    added = math.sqrt(effect.fault.size**2 - 1.0) * readings.deviations(rows) * draws
    effect.move(readings, rows, lambda z: z + added[:, effect.channels])


def _spike(effect: Effect, readings: Readings, rows: Rows) -> None:
    if effect.fault.duration_ns is None:
        rows = rows[: 0 if effect.spent else 1]
        effect.spent = True
    effect.move(readings, rows, lambda z: z + effect.fault.size)


def _stuck(effect: Effect, readings: Readings, rows: Rows) -> None:
    held = effect.held
    if held is not None and len(held) == readings.z.shape[1]:
        # Bit for bit what it was: an angle is not even wrapped.
        whole = readings.z[rows]
        whole[:, effect.channels] = held[effect.channels]
        readings.z[rows] = whole


def _nan(effect: Effect, readings: Readings, rows: Rows) -> None:
    effect.move(readings, rows, lambda z: np.full_like(z, np.nan))


def _intermittent(effect: Effect, readings: Readings, rows: Rows) -> None:
    readings.keep[rows[effect.rng.random(rows.size) >= effect.fault.size]] = False


def _broken(effect: Effect, readings: Readings, rows: Rows) -> None:
    readings.keep[rows] = False


ACTS: dict[Kind, Callable[[Effect, Readings, Rows], None]] = {
    Kind.SCALE: _scale,
    Kind.BIAS: _bias,
    Kind.DRIFT: _drift,
    Kind.NOISE: _noise,
    Kind.SPIKE: _spike,
    Kind.STUCK: _stuck,
    Kind.NAN: _nan,
    Kind.INTERMITTENT: _intermittent,
    Kind.BROKEN: _broken,
}
