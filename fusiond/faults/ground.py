"""The impulses of one place: the columns of the response that a fault of its sensors may use, by entry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fusiond.faults.course import Suspect
from fusiond.faults.hypotheses import Hypothesis, Place
from fusiond.faults.response import Integers, Response
from fusiond.faults.window import ODD
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Kind

MOST_ODD = 25.0
"""However odd, an input's reading speaks for a burst by no more than this: machines are hit, too."""
UNSURE = 0.5
"""Share of a burst's size that its readings leave open: the input was not quite at its usual value meanwhile."""


@dataclass(frozen=True, slots=True)
class Ground:
    """Where a fault of one place may act.

    Args:
        response: whose columns these are.   entries: (o,) that begin a fold of the place, each an onset tried.
        t_s: (o,) mean time of each fold.   alone: (o,) whether it is one entry only.
        columns: (p,) of the response, by entry.   first: (o,) the first of each entry's columns.
        sensor, channel, at: (p,) whose each column is, and in which of the entries.
        reading, reading_channel, into: (r,) every error of a reading (of an input, over an interval): its entry, its
            channel, and which of the columns it shares.
        gram: (p, p) inner products of the columns.   matched: (p,).   variance: (p,) of each column's own noise, 1 for
            an input's.
    """

    response: Response
    entries: Integers
    t_s: Vector
    alone: NDArray[np.bool_]
    columns: Integers
    first: Integers
    sensor: Integers
    channel: Integers
    at: Integers
    reading: Integers
    reading_channel: Integers
    into: Integers
    gram: Matrix
    matched: Vector
    variance: Vector
    is_input: bool


def ground_of(response: Response, place: Place, inputs: tuple[int, ...] = ()) -> Ground:
    """Gather what a place's faults act through.

    Args:
        inputs: numbers of the process inputs, where the place is an input sensor; none where it updates.
    """
    if inputs:
        own, begins = np.arange(len(response)), response.begins_input
        reading, channel = np.repeat(own, len(inputs)), np.tile(np.array(inputs), len(own))
        column = response.held[reading, channel]
    else:
        own = np.flatnonzero(np.isin(response.sensor, np.array(place)) & (response.dof > 0))
        begins = response.begins
        at, channel = np.nonzero(response.raw[own] >= 0)
        reading = own[at]
        column = response.raw[reading, channel]
    entries, of_entry, many = np.unique(begins[own], return_inverse=True, return_counts=True)
    columns, lead, into = np.unique(column, return_index=True, return_inverse=True)
    at = np.searchsorted(entries, reading[lead])
    X, variance = response.impulses[:, columns], np.ones(len(columns))
    if not inputs:
        variance = np.maximum(np.sum(response.noise[reading[lead], channel[lead]] ** 2, axis=1), 1e-300)
    return Ground(
        response=response,
        entries=entries,
        t_s=np.bincount(of_entry, response.t_s[own]) / many,
        alone=many == 1,
        columns=columns,
        first=np.searchsorted(at, np.arange(len(entries))),
        sensor=np.full(len(columns), place[0]) if inputs else response.sensor[reading[lead]],
        channel=channel[lead],
        at=at,
        reading=reading,
        reading_channel=channel,
        into=into,
        gram=X.T @ X,
        matched=response.matched[columns],
        variance=variance,
        is_input=bool(inputs),
    )


def weights(ground: Ground, kind: Kind, part: tuple[Suspect, ...]) -> Vector:
    """(p,) what one unit of a part's size does through each column, time left out."""
    response = ground.response
    member = np.zeros(len(ground.columns), dtype=bool)
    for suspect in part:
        member |= (ground.sensor == suspect.sensor) & (ground.channel == suspect.channel)
    if kind is Kind.SCALE:
        return np.where(member, _mean(ground, response.h), 0.0)
    if kind is Kind.DELAY:
        return np.where(member, -_mean(ground, response.hdot), 0.0)
    return member.astype(np.float64)


def _mean(ground: Ground, values: Matrix) -> Vector:
    """(p,) mean of (W, m) values over the readings that share each column."""
    return np.asarray(
        np.bincount(ground.into, values[ground.reading, ground.reading_channel]) / np.bincount(ground.into)
    )


def onward(M: Matrix) -> Vector:
    """(o,) sums of M[j, k] over j, k >= o, for every o."""
    corner = np.triu(M).sum(axis=1) + np.tril(M, -1).sum(axis=0)
    return np.cumsum(corner[::-1])[::-1]


def information(ground: Ground, hypothesis: Hypothesis) -> tuple[Matrix, Matrix]:
    """a (o, q, q) and b (o, q) of a hypothesis for every onset."""
    q, count = len(hypothesis.parts), len(ground.entries)
    a, b = np.empty((count, q, q)), np.empty((count, q))
    parts = [weights(ground, hypothesis.kind, part) for part in hypothesis.parts]
    for i, wi in enumerate(parts):
        matched = np.add.reduceat(wi * ground.matched, ground.first)
        b[:, i] = _sum_vector(hypothesis.kind, matched, ground.t_s)
        for j, wj in enumerate(parts[: i + 1]):
            block = np.add.reduceat(wi[:, None] * ground.gram * wj, ground.first, axis=0)
            block = np.add.reduceat(block, ground.first, axis=1)
            a[:, i, j] = a[:, j, i] = _sum_matrix(hypothesis.kind, block, ground.t_s)
    if hypothesis.kind is Kind.SPIKE:
        return _bursts(ground, hypothesis, a, b)
    return a, b


def _bursts(ground: Ground, hypothesis: Hypothesis, a: Matrix, b: Matrix) -> tuple[Matrix, Matrix]:
    """A spike is one reading, which a fold does not show; of an input a run of odd ones, which may not be real."""
    if not ground.is_input:
        a[~ground.alone], b[~ground.alone] = 0.0, 0.0
        return a, b
    a[:], b[:] = 0.0, 0.0
    begins = burst_of(ground, hypothesis)
    for o in np.unique(begins[begins >= 0]):
        P = profile_of(ground, hypothesis, int(o))
        a[o], b[o] = P.T @ ground.gram @ P, P.T @ ground.matched
    return a, b


def burst_of(ground: Ground, hypothesis: Hypothesis) -> Integers:
    """(o,) entry of the ground at which the run of unusual readings of an input that each is in begins; -1: none.

    Somewhere in the run a reading is odd, all along one is half as far off; and the run is over.
    """
    number, entries = hypothesis.parts[0][0].channel, ground.entries
    unusual = (ground.response.odd[entries, number] > 0.25 * ODD * ODD) & ground.alone
    lead = unusual & ~np.concatenate(([False], unusual[:-1]))
    run = np.where(unusual, np.cumsum(lead), 0)
    odd = np.bincount(run, ground.response.odd_count[entries, number])
    odd[0] = 0.0
    if unusual[-1]:
        odd[-1] = 0.0
    return np.where(odd[run] > 0.0, np.concatenate(([-1], np.flatnonzero(lead)))[run], -1)


def oddity(ground: Ground, hypothesis: Hypothesis, onset: int) -> float:
    """Log likelihood by which an input's own readings speak for a burst that begins there; 0 for everything else.

    They say how large it would be: as far as they were from what is usual. Where the innovations contradict that, the
    input did move, however oddly; and what they do not bear out has no more than their own weight.
    """
    if hypothesis.kind is not Kind.SPIKE or not ground.is_input:
        return 0.0
    entries = ground.entries[burst_of(ground, hypothesis) == onset]
    square = float(np.max(ground.response.odd[entries, hypothesis.parts[0][0].channel], initial=0.0))
    borne_out = burst_likelihood(ground, hypothesis, onset)
    return min(0.5 * square, MOST_ODD, borne_out) if borne_out > 0.0 else borne_out


def burst_likelihood(ground: Ground, hypothesis: Hypothesis, onset: int) -> float:
    """Log likelihood ratio of the innovations for a burst of the size its readings say, against none.

    With P the deviations of the readings from what is usual, w = X P, a = w'w, b = w'e, and the true size c P,
    c ~ N(1, v): [b^2 v + 2 b - a] / (2 (1 + a v)) - ln(1 + a v) / 2.
    """
    number = hypothesis.parts[0][0].channel
    in_run = (burst_of(ground, hypothesis) == onset)[ground.at]
    away = np.where(in_run, ground.response.away[ground.entries[ground.at], number], 0.0)
    P = away * weights(ground, hypothesis.kind, hypothesis.parts[0])
    a, b, v = float(P @ ground.gram @ P), float(P @ ground.matched), UNSURE**2
    return (b * b * v + 2.0 * b - a) / (2.0 * (1.0 + a * v)) - 0.5 * float(np.log1p(a * v))


def _sum_vector(kind: Kind, matched: Vector, t_s: Vector) -> Vector:
    """Sum over the entries from each onset on, by the kind's course in time."""
    if kind is Kind.SPIKE:
        return matched
    plain = np.cumsum(matched[::-1])[::-1]
    if kind is not Kind.DRIFT:
        return plain
    return np.cumsum((matched * t_s)[::-1])[::-1] - t_s * plain


def _sum_matrix(kind: Kind, block: Matrix, t_s: Vector) -> Vector:
    """Sum over pairs of entries from each onset on, by the kind's course in time."""
    if kind is Kind.SPIKE:
        return np.diagonal(block).copy()
    if kind is not Kind.DRIFT:
        return onward(block)
    once = onward(t_s[:, None] * block) + onward(block * t_s)
    return onward(t_s[:, None] * block * t_s) - t_s * once + t_s**2 * onward(block)


def profile_of(ground: Ground, hypothesis: Hypothesis, onset: int) -> Matrix:
    """(p, q) errors in each column for a unit of each size, from the ground's entry number `onset` on."""
    course = (ground.at >= onset).astype(np.float64)
    if hypothesis.kind is Kind.SPIKE and ground.is_input:
        course = (burst_of(ground, hypothesis) == onset)[ground.at].astype(np.float64)
    elif hypothesis.kind is Kind.SPIKE:
        course = (ground.at == onset).astype(np.float64)
    if hypothesis.kind is Kind.DRIFT:
        course *= ground.t_s[ground.at] - ground.t_s[onset]
    return np.stack([weights(ground, hypothesis.kind, part) * course for part in hypothesis.parts], axis=1)


def basis(ground: Ground, hypothesis: Hypothesis, onset: int) -> Matrix:
    """(E, q) whitened means for a unit of each size of a fault that begins at the ground's entry number `onset`."""
    return ground.response.impulses[:, ground.columns] @ profile_of(ground, hypothesis, onset)


def free(ground: Ground, onset: int) -> tuple[float, int]:
    """What errors of any shape in the place's readings from entry `onset` of the window on explain of e'e.

    Returns:
        The sum of squares they explain, and by how many numbers. What remains are the innovations of the filter that
        does not hear the place.
    """
    own = ground.entries[ground.at] >= onset
    if not np.any(own):
        return 0.0, 0
    lengths, V = np.linalg.eigh(ground.gram[np.ix_(own, own)])
    kept = lengths > 1e-9 * max(float(lengths[-1]), 1e-300)
    y = V[:, kept].T @ ground.matched[own]
    return float(np.sum(y * y / lengths[kept])), int(np.sum(kept))
