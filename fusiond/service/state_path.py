"""Where a filter was lately: what a reading is linearised at."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque

import numpy as np
from numpy.typing import NDArray

from fusiond.numerics.discretise import wrap_angle
from fusiond.numerics.kernel import interpreted

Vector = NDArray[np.float64]
KEPT_STATES = 1024


class StatePath:
    """The newest states with their times.

    Args:
        angles: (states,) whether a state is an angle, rad.
    """

    def __init__(self, angles: NDArray[np.bool_]) -> None:
        self._angles = angles
        self._t_ns: deque[int] = deque(maxlen=KEPT_STATES)
        self._x: deque[Vector] = deque(maxlen=KEPT_STATES)

    @property
    def newest_ns(self) -> int | None:
        """Time of the newest state, None before the first."""
        return self._t_ns[-1] if self._t_ns else None

    def note(self, t_ns: int, x: Vector) -> None:
        """Remember a state; of one time the newest counts, and where time goes back what was before is forgotten."""
        if self._t_ns and t_ns == self._t_ns[-1]:
            self._x[-1] = x
            return
        if self._t_ns and t_ns < self._t_ns[-1]:
            self._t_ns.clear()
            self._x.clear()
        self._t_ns.append(t_ns)
        self._x.append(x)

    def at(self, t_ns: int) -> Vector:
        """The state then, between the two remembered around it; the first or last beyond them. At least one is."""
        after = bisect_right(self._t_ns, t_ns)
        if after == 0 or after == len(self._t_ns):
            return self._x[0 if after == 0 else -1]
        before_ns, before = self._t_ns[after - 1], self._x[after - 1]
        apart = self._x[after] - before
        turn = interpreted(wrap_angle)
        apart = np.array([turn(a) if angle else a for a, angle in zip(apart, self._angles, strict=True)])
        moved: Vector = before + apart * ((t_ns - before_ns) / (self._t_ns[after] - before_ns))
        return moved
