"""Walking through a run once more, in the order of time."""

from __future__ import annotations

import hashlib
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

    def follow(self, readings: Records) -> Records:
        """Apply accepted readings in the order given, the order of time, and resets where they came between them.

        Returns: their updates, (k,) of `dtype`.
        """
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

    def state_sha256(self) -> str:
        """Hash of the track record's bytes: the engine's own where every step was followed."""
        return hashlib.sha256(self._track.tobytes()).hexdigest()
