"""The impulses of one place: the columns of the response that a fault of its sensors may use, by entry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusiond.faults.course import Suspect
from fusiond.faults.hypotheses import Hypothesis, Place
from fusiond.faults.response import Integers, Response
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Kind


@dataclass(frozen=True, slots=True)
class Ground:
    """Where a fault of one place may act.

    Args:
        response: whose columns these are.   entries: (o,) with a reading of the place; every entry for an input.
        columns: (p,) of the response, by entry.   first: (o,) the first of each entry's columns.
        sensor, channel, at: (p,) whose each column is, and in which of the entries.
        gram: (p, p).   matched: (p,).   variance: (p,) of each column's own noise, 1 for an input's.
    """

    response: Response
    entries: Integers
    columns: Integers
    first: Integers
    sensor: Integers
    channel: Integers
    at: Integers
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
        entries = np.arange(len(response))
        at = np.repeat(entries, len(inputs))
        channel = np.tile(np.array(inputs), len(entries))
        columns, sensor = response.held[at, channel], np.full(len(at), place[0])
        variance = np.ones(len(at))
    else:
        own = np.isin(response.sensor, np.array(place)) & (response.dof > 0)
        entries = np.flatnonzero(own)
        at, channel = np.nonzero(response.raw[entries] >= 0)
        columns, sensor = response.raw[entries[at], channel], response.sensor[entries[at]]
        variance = np.maximum(np.sum(response.noise[entries[at], channel] ** 2, axis=1), 1e-300)
    gram = response.gram[np.ix_(columns, columns)]
    first = np.searchsorted(at, np.arange(len(entries)))
    return Ground(
        response,
        entries,
        columns,
        first,
        sensor,
        channel,
        at,
        gram,
        response.matched[columns],
        variance,
        bool(inputs),
    )


def weights(ground: Ground, kind: Kind, part: tuple[Suspect, ...]) -> Vector:
    """(p,) what one unit of a part's size does through each column, time left out."""
    response, at = ground.response, ground.entries[ground.at]
    member = np.zeros(len(ground.columns), dtype=bool)
    for suspect in part:
        member |= (ground.sensor == suspect.sensor) & (ground.channel == suspect.channel)
    if kind is Kind.SCALE:
        return np.where(member, response.h[at, ground.channel], 0.0)
    if kind is Kind.DELAY:
        return np.where(member, -response.hdot[at, ground.channel], 0.0)
    return member.astype(np.float64)


def onward(M: Matrix) -> Vector:
    """(o,) sums of M[j, k] over j, k >= o, for every o."""
    corner = np.triu(M).sum(axis=1) + np.tril(M, -1).sum(axis=0)
    return np.cumsum(corner[::-1])[::-1]


def information(ground: Ground, hypothesis: Hypothesis) -> tuple[Matrix, Matrix]:
    """a (o, q, q) and b (o, q) of a hypothesis for every onset."""
    q, count = len(hypothesis.parts), len(ground.entries)
    a, b = np.empty((count, q, q)), np.empty((count, q))
    parts = [weights(ground, hypothesis.kind, part) for part in hypothesis.parts]
    t_s = ground.response.t_s[ground.entries]
    for i, wi in enumerate(parts):
        matched = np.add.reduceat(wi * ground.matched, ground.first)
        b[:, i] = _sum_vector(hypothesis.kind, matched, t_s)
        for j, wj in enumerate(parts[: i + 1]):
            block = np.add.reduceat(wi[:, None] * ground.gram * wj, ground.first, axis=0)
            block = np.add.reduceat(block, ground.first, axis=1)
            a[:, i, j] = a[:, j, i] = _sum_matrix(hypothesis.kind, block, t_s)
    return a, b


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
    if hypothesis.kind is Kind.SPIKE:
        course = (ground.at == onset).astype(np.float64)
    if hypothesis.kind is Kind.DRIFT:
        t_s = ground.response.t_s[ground.entries]
        course *= t_s[ground.at] - t_s[onset]
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
