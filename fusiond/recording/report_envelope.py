"""A long series as few intervals, smallest and largest value of each: what a picture shows, in memory that is fixed."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.types import NANOSECONDS


class Envelope:
    """Smallest, largest and last value of several columns over equal intervals of time.

    Intervals start as a microsecond and are joined two by two whenever `capacity` of them do not reach the newest
    time, so that nobody has to know beforehand how long a run is. Every value lies within its interval's bounds.

    Args:
        columns: numbers of one row.
        capacity: most intervals kept, even; more than half of them cover the run.
        origin_ns: where the first interval starts; what is earlier counts as being there.
    """

    def __init__(self, columns: int, capacity: int, origin_ns: int) -> None:
        self.origin_ns = origin_ns
        self.width_ns = 1000
        self.low = np.full((capacity, columns), np.nan)
        self.high = np.full((capacity, columns), np.nan)
        self.last = np.full((capacity, columns), np.nan)
        self.count = np.zeros(capacity, np.int64)

    def add(self, t_ns: NDArray[np.int64], values: NDArray[Any]) -> None:
        """Take rows (K, columns) at the times (K,); a value that is no number counts as none."""
        if not len(t_ns):
            return
        since_ns = np.maximum(t_ns - self.origin_ns, 0)
        while int(since_ns.max()) // self.width_ns >= len(self.count):
            self._join()
        at = since_ns // self.width_ns
        order = np.argsort(at, kind="stable")
        at, rows = at[order], np.asarray(values[order], np.float64)
        starts = np.flatnonzero(np.diff(at, prepend=-1))
        bins = at[starts]
        self.low[bins] = np.fmin(self.low[bins], np.fmin.reduceat(rows, starts, axis=0))
        self.high[bins] = np.fmax(self.high[bins], np.fmax.reduceat(rows, starts, axis=0))
        self.last[bins] = rows[np.append(starts[1:], len(rows)) - 1]
        self.count[bins] += np.diff(np.append(starts, len(rows)))

    def filled(self) -> NDArray[np.int64]:
        """Numbers of the intervals that hold any row."""
        return np.flatnonzero(self.count)

    def t_s(self, bins: NDArray[np.int64]) -> NDArray[np.float64]:
        """Middles of intervals, s since the origin."""
        return np.asarray((bins + 0.5) * (self.width_ns / NANOSECONDS))

    def _join(self) -> None:
        half = len(self.count) // 2
        even, odd = slice(0, None, 2), slice(1, None, 2)
        later = self.count[odd] > 0
        self.last[:half] = np.where(later[:, None], self.last[odd], self.last[even])
        self.low[:half] = np.fmin(self.low[even], self.low[odd])
        self.high[:half] = np.fmax(self.high[even], self.high[odd])
        self.count[:half] = self.count[even] + self.count[odd]
        for kept in (self.low, self.high, self.last):
            kept[half:] = np.nan
        self.count[half:] = 0
        self.width_ns *= 2
