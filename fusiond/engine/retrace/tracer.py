"""Walking through a run once more, in the order of time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.engine.retrace.records import pass_dtype, retrace_work_dtype

Records = NDArray[Any]


class Tracer:
    """A track that is led by readings in the order of their time, so that nothing is ever rolled back.

    Args:
        design: (1,) design record.   run: the compiled entry of the retracing step.
    """

    def __init__(self, layout: Layout, design: Records, run: Callable[..., int]) -> None:
        self.layout = layout
        self.dtype = pass_dtype(layout.shape)
        self._design, self._run = design, run
        self._track: Records = np.zeros(1, layout.track)
        self._work: Records = np.zeros(1, retrace_work_dtype(layout.shape))
        self._scratch = (np.zeros(1, layout.desk), np.zeros(1, np.int64), np.zeros(1, layout.report))

    def follow(self, readings: Records, reaction: Records | None = None) -> Records:
        """Apply accepted readings in the order given, the order of time, and resets where they came between them.

        Args:
            reaction: what had been decided about the sensors' faults, (1,) as in the engine's track; as before without.
        Returns: their updates, (k,) of `dtype`.
        """
        if reaction is not None:
            self._track["reaction"] = reaction
        passes: Records = np.zeros(len(readings), self.dtype)
        count = self._run(self._track, self._design, self._work, *self._scratch, readings, passes)
        return passes[:count]

    def prepare(self) -> None:
        """Compile the step, or load it from the cache."""
        self.follow(np.zeros(0, self.layout.reading))

    def shift(self, shift_ns: int) -> None:
        """Carry the track to a new time base."""
        for name in ("t_ns", "start_ns", "update_ns", "filter_t_ns", "sensor_t_ns"):
            self._track[name] += shift_ns

    def ends_like(self, track: Records) -> bool:
        """Whether the centralized filter is now, bit for bit, that of another track, (1,): the engine's own."""
        mine, other = (
            [one[name][0, 0].tobytes() for name in ("filter_t_ns", "x", "U", "d")]
            for one in (self._track, track)
        )
        return mine == other
