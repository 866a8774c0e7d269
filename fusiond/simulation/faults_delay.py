"""What a sensor measured a while ago: its last readings, and their values in between."""

from __future__ import annotations

import numpy as np

from fusiond.simulation.tables import Floats, Times
from fusiond.types import NANOSECONDS

SPARE_NS = 10 * NANOSECONDS
"""How much longer than the delay readings are kept: a reading may come late by as much and still find its neighbours.
A clock that steps back further begins anew."""
TWO_PI = 2.0 * np.pi


def wrapped(angle_rad: Floats) -> Floats:
    """Angles in (-pi, pi]; one that lies there already keeps its bits, as does what is not finite."""
    outside = np.isfinite(angle_rad) & ((angle_rad > np.pi) | (angle_rad <= -np.pi))
    if not outside.any():
        return angle_rad
    out = angle_rad.copy()
    out[outside] = np.pi - np.mod(np.pi - angle_rad[outside], TWO_PI)
    return out


class DelayLine:
    """Readings of one sensor by their stamps; what comes out does not depend on how they are cut into batches.

    Args:
        keep_ns: longest delay that will be asked for.      angles: channels that live on a circle.
    """

    def __init__(self, keep_ns: int, angles: frozenset[int]) -> None:
        self._keep_ns = keep_ns + SPARE_NS
        self._angles = angles
        self._first = self._end = 0
        self._t_ns: Times = np.zeros(64, np.int64)
        self._z: Floats = np.zeros((64, 0))

    def keep(self, keep_ns: int) -> None:
        """Longer delays will be asked for from now on."""
        self._keep_ns = max(self._keep_ns, keep_ns + SPARE_NS)

    def feed(self, t_ns: Times, z: Floats, delay_ns: Times) -> Floats:
        """Take new readings; returns their values of a while ago.

        Args:
            t_ns: (k,) in order of arrival.      z: (k, m).      delay_ns: (k, m) >= 0; where 0, the value itself.
        A reading knows those that arrived before it and no other. Before the first one the first value holds.
        """
        ordered = not self._count() or t_ns[0] >= self._t_ns[self._end - 1]
        if ordered and bool(np.all(t_ns[1:] >= t_ns[:-1])):
            self._append(t_ns, z)
            out = self._values(t_ns, z, delay_ns) if delay_ns.any() else z
            self._forget()
            return out
        return np.concatenate([self._one(t_ns[[k]], z[[k]], delay_ns[[k]]) for k in range(len(t_ns))])

    def _one(self, t_ns: Times, z: Floats, delay_ns: Times) -> Floats:
        """One reading, which may be older than the newest."""
        if self._count() and t_ns[0] < self._t_ns[self._end - 1] - self._keep_ns:
            self._first = self._end = 0
        at = int(np.searchsorted(self._t_ns[self._first : self._end], t_ns[0], side="right")) + self._first
        self._append(t_ns, z)
        for column in (self._t_ns, self._z):
            column[at + 1 : self._end] = column[at : self._end - 1].copy()
        self._t_ns[at], self._z[at] = t_ns[0], z[0]
        out = self._values(t_ns, z, delay_ns) if delay_ns.any() else z
        self._forget()
        return out

    def _values(self, t_ns: Times, z: Floats, delay_ns: Times) -> Floats:
        """Linear between the two readings around each asked time; an angle takes the shorter way."""
        known_ns, known = self._t_ns[self._first : self._end], self._z[self._first : self._end]
        out = z.copy()
        for channel in range(z.shape[1]):
            rows = np.flatnonzero(delay_ns[:, channel])
            asked_ns = t_ns[rows] - delay_ns[rows, channel]
            after = np.searchsorted(known_ns, asked_ns, side="right")
            right = np.clip(after, 1, max(1, len(known_ns) - 1))
            left = right - 1
            right = np.minimum(right, len(known_ns) - 1)
            span_ns = known_ns[right] - known_ns[left]
            share = np.clip((asked_ns - known_ns[left]) / np.where(span_ns > 0, span_ns, 1), 0.0, 1.0)
            step = known[right, channel] - known[left, channel]
            if channel in self._angles:
                step = wrapped(step)
            between = known[left, channel] + share * step
            between = wrapped(between) if channel in self._angles else between
            out[rows, channel] = np.where(share > 0.0, between, known[left, channel])
        return out

    def _count(self) -> int:
        return self._end - self._first

    def _append(self, t_ns: Times, z: Floats) -> None:
        more, count = len(t_ns), self._count()
        if self._z.shape[1] != z.shape[1]:
            # Readings of another length have nothing in common with those before.
            count, self._first, self._end = 0, 0, 0
            self._z = np.zeros((len(self._t_ns), z.shape[1]))
        if self._end + more > len(self._t_ns):
            size = max(2 * (count + more), 64)
            kept_ns, kept = np.zeros(size, np.int64), np.zeros((size, z.shape[1]))
            kept_ns[:count] = self._t_ns[self._first : self._end]
            kept[:count] = self._z[self._first : self._end]
            self._t_ns, self._z, self._first, self._end = kept_ns, kept, 0, count
        self._t_ns[self._end : self._end + more] = t_ns
        self._z[self._end : self._end + more] = z
        self._end += more

    def _forget(self) -> None:
        """Drop what is too old, but for the last of it: it is the left neighbour of what is not."""
        known_ns = self._t_ns[self._first : self._end]
        old = int(np.searchsorted(known_ns, known_ns[-1] - self._keep_ns, side="right"))
        self._first += max(0, old - 1)
