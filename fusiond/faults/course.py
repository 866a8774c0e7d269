"""A healthy stretch of readings, linearised: everything about the running filter that a fault's signature depends on.

One period of W entries (readings of updating sensors), taken to repeat for ever; n errors, m channels, k inputs. The
fields mean what those of the window ring mean: `H`, `root`, `K` per scalar, decorrelated channel; `D[c, ch]` is what a
unit fault of raw channel ch does to decorrelated channel c; `T`, `B` lead from the entry before to this one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fusiond.numerics.ud import Matrix, Vector

Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Course:
    """One period of a healthy, steady (or trial-averaged) run.

    Args:
        t_s: (W,) stamps.   period_s: the next period begins with t_s[0] + period_s.
        sensor, dof: (W,).   H, K: (W, m, n).   root: (W, m).   D: (W, m, m).   T: (W, n, n).   B: (W, n, k).
        h, hdot: (W, m) predicted raw reading and its rate of change, 1/s.
        moving: whether the states move along the trial, so that h and hdot mean something.
    """

    t_s: Vector
    period_s: float
    sensor: Integers
    dof: Integers
    H: Matrix
    K: Matrix
    root: Matrix
    D: Matrix
    T: Matrix
    B: Matrix
    h: Matrix
    hdot: Matrix
    moving: bool

    def __len__(self) -> int:
        """Entries of one period."""
        return len(self.t_s)


@dataclass(frozen=True, slots=True)
class Suspect:
    """What may be wrong: one raw channel of an updating sensor, or one input of an input sensor.

    Args:
        sensor: its number.   channel: raw channel, or number of the process input.   is_input: which of the two.
    """

    sensor: int
    channel: int
    is_input: bool


@dataclass(frozen=True, slots=True)
class Curve:
    """Information a constant unit fault leaves in each entry after its onset: sum of w^2, w = whitened mean.

    Args:
        information: (entries,) from the onset on; theta^2 times it is twice the Kullback-Leibler information.
        own: (entries,) whether a reading of the faulty sensor itself (any reading, for an input).
        steady: information per own reading in the long run.   readings_per_s: own readings.
        pattern: entries of a period; the last ones of the curve repeat from then on.
    """

    information: Vector
    own: NDArray[np.bool_]
    steady: float
    readings_per_s: float
    pattern: int

    def per_reading(self) -> Vector:
        """Information summed from each own reading to the next, the first one at the onset."""
        places = np.cumsum(self.own) - 1
        return np.asarray(np.bincount(np.maximum(places, 0), weights=self.information), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Signatures:
    """What every suspect's fault does to the innovations.

    Args:
        suspects: the hypotheses.   curves: for each its curves, from up to `STARTS` onsets within a period.
        steady: (suspects, suspects) information per second in the long run, w_i w_j summed.
        total: (suspects, suspects) information of the whole trial from an onset at its start.
        duration_s: of the trial.
    """

    suspects: tuple[Suspect, ...]
    curves: tuple[tuple[Curve, ...], ...]
    steady: Matrix
    total: Matrix
    duration_s: float

    def products(self, chosen: Sequence[int]) -> Matrix:
        """Inner products of the chosen suspects' signatures: in the long run where all last, else of the trial."""
        pick = np.ix_(chosen, chosen)
        lasting = np.all(np.diagonal(self.steady)[list(chosen)] > 0.0)
        return self.steady[pick] if lasting else self.total[pick]

    def correlation(self) -> Matrix:
        """(suspects, suspects) of the signatures, pair by pair as in `products`."""
        count = len(self.suspects)
        found = np.eye(count)
        for i in range(count):
            for j in range(i):
                both = self.products((i, j))
                scale = np.sqrt(both[0, 0] * both[1, 1])
                found[i, j] = found[j, i] = both[0, 1] / scale if scale > 0.0 else 0.0
        return found


Growth = Literal["constant", "ramp", "scale", "delay"]
"""How a fault of unit size goes with time: 1, seconds since its onset, h, or minus the rate of change of h."""

STARTS = 2
"""Onsets within a period from which a fault's signature is followed."""
LONGEST = 1200
"""Entries after which no more is learnt of how a signature settles."""
SETTLED = 2e-3
"""Relative difference of the information in the last two eighths of the trial at which a signature has settled."""
SPENT = 1e-3
"""Share of its whole information that a fading signature still adds in the last quarter when it is spent."""
SHORTEST = 16
"""Periods before a signature is asked whether it has settled: a fading one passes through zero."""


def onsets(course: Course, suspect: Suspect) -> list[int]:
    """Entries of the first period at which a fault of the suspect begins, spread evenly over its own readings."""
    own = np.arange(len(course)) if suspect.is_input else np.flatnonzero(course.sensor == suspect.sensor)
    picked = np.unique(np.linspace(0, len(own), min(STARTS, len(own)), endpoint=False).astype(int))
    return [int(own[i]) for i in picked]


@dataclass(slots=True)
class _Columns:
    """One column for each suspect and onset; the last `suspects` of them begin at the course's first entry."""

    who: Integers
    start: Integers
    sensor: Integers
    channel: Integers
    is_input: NDArray[np.bool_]


def _columns(course: Course, suspects: tuple[Suspect, ...]) -> _Columns:
    pairs = [(i, start) for i, suspect in enumerate(suspects) for start in onsets(course, suspect)]
    pairs += [(i, 0) for i in range(len(suspects))]
    who = np.array([i for i, _ in pairs], dtype=np.int64)
    return _Columns(
        who,
        np.array([start for _, start in pairs], dtype=np.int64),
        np.array([suspects[i].sensor for i in who], dtype=np.int64),
        np.array([suspects[i].channel for i in who], dtype=np.int64),
        np.array([suspects[i].is_input for i in who], dtype=bool),
    )


def _profile(course: Course, columns: _Columns, growth: Growth, turn: int, k: int) -> Vector:
    """(columns,) error of each column's channel or input at entry k of a period, for a fault of unit size."""
    if growth == "ramp":
        return np.asarray(turn * course.period_s + course.t_s[k] - course.t_s[columns.start])
    if growth == "constant":
        return np.ones(len(columns.who))
    values = course.h[k] if growth == "scale" else -course.hdot[k]
    return np.asarray(np.where(columns.is_input, 0.0, values[np.minimum(columns.channel, len(values) - 1)]))


def _one_period(
    course: Course, columns: _Columns, phi: Matrix, turn: int, growth: Growth
) -> tuple[Matrix, Matrix]:
    """Carry signatures phi (n, columns) through one period; returns phi and w (W, m, columns)."""
    W, m = course.root.shape
    w = np.zeros((W, m, len(columns.who)))
    driving = np.flatnonzero(columns.is_input)
    for k in range(W):
        begun = (turn > 0) | (columns.start <= k)
        error = _profile(course, columns, growth, turn, k) * begun
        phi = course.T[k] @ phi
        # an input's error acts on the interval before the reading: one that begins with entry k has driven to it
        phi[:, driving] += course.B[k][:, columns.channel[driving]] * error[driving]
        hit = np.flatnonzero(~columns.is_input & (columns.sensor == course.sensor[k]) & begun)
        for c in range(course.dof[k]):
            rho = -course.H[k, c] @ phi
            rho[hit] += course.D[k, c, columns.channel[hit]] * error[hit]
            w[k, c] = rho / course.root[k, c] if course.root[k, c] > 0.0 else 0.0
            phi += np.outer(course.K[k, c], rho)
    return phi, w


def _settled(sums: list[Vector]) -> tuple[bool, NDArray[np.bool_]]:
    """Whether every column's information per period neither changes nor matters any more; and which are spent.

    Args:
        sums: for each period (columns,) its information.
    """
    every = np.array(sums)
    eighth = max(1, len(every) // 8)
    last, before = every[-eighth:].sum(axis=0), every[-2 * eighth : -eighth].sum(axis=0)
    spent = last + before <= SPENT * every.sum(axis=0)
    return bool(np.all((np.abs(last - before) <= SETTLED * last) | spent)), spent


def signatures(course: Course, suspects: tuple[Suspect, ...], growth: Growth = "constant") -> Signatures:
    """Follow a unit fault of every suspect through the course until it has settled, or LONGEST entries."""
    columns = _columns(course, suspects)
    phi: Matrix = np.zeros((course.T.shape[1], len(columns.who)))
    periods: list[Matrix] = []
    sums: list[Vector] = []
    most = max(2, LONGEST // len(course))
    spent = np.zeros(len(columns.who), dtype=bool)
    for turn in range(1, most + 1):
        phi, w = _one_period(course, columns, phi, turn - 1, growth)
        periods.append(w)
        sums.append(np.sum(w * w, axis=(0, 1)))
        if turn == most or (turn >= SHORTEST and turn % 8 == 0):
            done, spent = _settled(sums)
            if done:
                break
    shared = len(columns.who) - len(suspects)
    steady = np.einsum("kci,kcj->ij", periods[-1][:, :, shared:], periods[-1][:, :, shared:])
    steady[spent[shared:]] = 0.0
    steady[:, spent[shared:]] = 0.0
    every = np.concatenate(periods)
    total = np.einsum("kci,kcj->ij", every[:, :, shared:], every[:, :, shared:])
    curves = _curves(course, suspects, columns, every, np.diagonal(steady))
    return Signatures(suspects, curves, steady / course.period_s, total, course.period_s * len(periods))


def _curves(
    course: Course, suspects: tuple[Suspect, ...], columns: _Columns, w: Matrix, steady: Vector
) -> tuple[tuple[Curve, ...], ...]:
    """Information of each column from its own onset on."""
    information = np.einsum("kci,kci->ki", w, w)
    sensors = np.resize(course.sensor, len(information))
    curves: list[tuple[Curve, ...]] = []
    for i, suspect in enumerate(suspects):
        own = np.ones(len(sensors), dtype=bool) if suspect.is_input else sensors == suspect.sensor
        count = len(course) if suspect.is_input else int(np.sum(course.sensor == suspect.sensor))
        begun = np.flatnonzero(columns.who[: len(columns.who) - len(suspects)] == i)
        curves.append(
            tuple(
                Curve(
                    information[columns.start[j] :, j],
                    own[columns.start[j] :],
                    float(steady[i]) / count,
                    count / course.period_s,
                    len(course),
                )
                for j in begun
            )
        )
    return tuple(curves)
