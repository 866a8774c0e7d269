"""Smoothing a replay: its updates kept in the order of time and walked back, smoothed states handed out forwards."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.engine.records import record
from fusiond.engine.retrace.tracer import Tracer
from fusiond.filters.smoother import Adjoint, before_channel, before_interval, end, smoothed
from fusiond.recording.smoothing_order import InOrder, Shift
from fusiond.recording.smoothing_tape import Tape
from fusiond.types import Action

Records = NDArray[Any]
Floats = NDArray[np.float64]
Inject = Callable[[Floats, Floats], Floats]


def smoothed_dtype(layout: Layout) -> np.dtype[Any]:
    """One smoothed state: its time, x, and the covariance P (n, n) of its error."""
    n = layout.shape.errors
    return record(("state_t_ns", "<i8"), ("x", "<f8", (layout.shape.states,)), ("P", "<f8", (n, n)))


class Smoother:
    """Watches a replay, then smooths it; closed by the caller.

    Its memory does not grow with the run: readings are held for the filter's horizon, updates on a tape.

    Args:
        tracer: before its first reading.   design: (1,) design record.
        inject: x [+] dx of one state, angles on the circle.
        track: (1,) the engine's own, in which its decisions about faults stand.
    A reading is taken as it is judged once its time is up (`InOrder`): a sensor that was excluded for having lied since
    an onset has said nothing since then. To see decisions in time, give chunks of PIECE readings.
    """

    def __init__(self, tracer: Tracer, design: Records, inject: Inject, track: Records) -> None:
        self.segments = 0
        self._tracer, self._inject, self._track = tracer, inject, track
        self._reaction = track["reaction"].copy()
        self._n = tracer.layout.shape.errors
        self._order = InOrder(tracer.layout, design)
        self._passes = Tape(tracer.dtype)
        self._reversed = Tape(smoothed_dtype(tracer.layout))

    def close(self) -> None:
        """Give the tapes' space back."""
        self._passes.close()
        self._reversed.close()

    @property
    def updates(self) -> int:
        """Updates seen."""
        return self._passes.rows

    def witness(self, readings: Records, reports: Records) -> None:
        """Take one chunk of the replay."""
        jumps = bool(np.isin(reports["action"], (Action.RESET, Action.RETIMED)).any())
        if not jumps:
            self._reaction = self._track["reaction"].copy()
        for settled in self._order.add(readings, reports):
            if isinstance(settled, Shift):
                self._tracer.shift(settled.shift_ns)
            else:
                self._follow(settled)
        self._reaction = self._track["reaction"].copy()

    def finish(self) -> bool:
        """Smooth what was seen; returns whether the retraced run ended in the engine's own state, bit for bit."""
        self._follow(self._order.rest())
        followed = self._tracer.ends_like(self._track)
        adjoint = end(self._n)
        for block in self._passes.backwards():
            adjoint = self._walk_back(block, adjoint)
        return followed

    def filtered(self) -> Iterator[Records]:
        """What the filter knew after each update, in the order of time: blocks with `t_ns`, `x`, `U`, `d`."""
        return self._passes.forwards()

    def smoothed(self) -> Iterator[Records]:
        """The smoothed states in the order of time: blocks of `smoothed_dtype`."""
        return self._reversed.backwards()

    def _follow(self, readings: Records) -> None:
        if len(readings):
            self._passes.append(self._tracer.follow(readings, self._reaction))

    def _walk_back(self, block: Records, adjoint: Adjoint) -> Adjoint:
        """Smooth one block, newest update first; returns the adjoint before it."""
        a, A = np.zeros((len(block), self._n)), np.zeros((len(block), self._n, self._n))
        for row, update in enumerate(block):
            a[row], A[row] = adjoint.a, adjoint.A
            adjoint = before_update(adjoint, update)
        dx, P = smoothed(block["U"], block["d"], a, A)
        out = np.zeros(len(block), self._reversed.dtype)
        out["state_t_ns"], out["P"] = block["t_ns"], P
        out["x"] = [self._inject(x, step) for x, step in zip(block["x"], dx, strict=True)]
        self._reversed.append(out)
        self.segments += int(np.count_nonzero(block["apart"]))
        return adjoint


def before_update(after: Adjoint, update: Any) -> Adjoint:
    """The adjoint after the update before this one (`pass_dtype`).

    Where nothing leads from there to here, or numbers are not finite any more, it begins anew.
    """
    h, k, nu, S = update["h"], update["k"], update["nu"], update["S"]
    adjoint = after
    for channel in reversed(range(int(update["channels"]))):
        adjoint = before_channel(adjoint, h[channel], k[channel], float(nu[channel]), float(S[channel]))
    adjoint = before_interval(adjoint, update["F"])
    return adjoint if adjoint.finite and not update["apart"] else end(after.a.shape[0])
