"""The readings of a run in the order of their time: what a rollback of the engine amounts to, without rolling back."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.engine.records import HAS_ARRIVAL
from fusiond.types import RESET, Action, Role, Verdict

Records = NDArray[Any]
APPLIED = (Verdict.USED, Verdict.HELD, Verdict.GATED, Verdict.EXCLUDED)
"""Verdicts of readings that have their place in time, whatever a later decision makes of them."""
LATEST_NS = int(np.iinfo(np.int64).max)
PIECE = 64
"""Readings after which a decision about a fault is seen."""


@dataclass(frozen=True, slots=True)
class Shift:
    """The time base moves by so much."""

    shift_ns: int


class InOrder:
    """Sorts accepted readings as the engine does: by stamp, sensor, sequence number, values, then arrival.

    No reading older than the newest by more than the horizon is ever accepted, so that no more than the horizon's
    readings are held, and, where faults are looked for, twice the window in which an onset may still be found; a reset
    or a jump of time lets go of all.

    Args:
        design: (1,) design record.
    """

    def __init__(self, layout: Layout, design: Records) -> None:
        self._delay_ns = design["delay_ns"][0]
        self._horizon_ns = int(design["horizon_ns"][0])
        moving = {Role.UPDATE, Role.INPUT}
        self._window = 2 * layout.shape.window if layout.shape.cells else 0
        self._updates = np.array([sensor.role == Role.UPDATE for sensor in layout.sensors] or [False])
        self._moves = np.array([sensor.role in moving for sensor in layout.sensors] or [False])
        self._held: Records = np.zeros(0, layout.reading)
        self._reset: Records = np.zeros(1, layout.reading)
        self._reset["sensor"] = RESET
        self._newest_ns: int | None = None
        self._newest_arrival_ns: int | None = None

    def add(self, readings: Records, reports: Records) -> Iterator[Records | Shift]:
        """Readings in arrival order with their reports in; what is settled out, in the order of time, resets too."""
        jumps = np.isin(reports["action"], (Action.RESET, Action.RETIMED))
        begin = 0
        for at in np.flatnonzero(jumps).tolist():
            self._hold(readings[begin:at], reports[begin:at])
            yield self._let_go(None)
            yield self._jump(readings[at], reports[at])
            begin = at
        self._hold(readings[begin:], reports[begin:])
        if self._newest_ns is not None:
            yield self._let_go(min(self._newest_ns - self._horizon_ns, self._still_judged_ns()))

    def rest(self) -> Records:
        """All that is still held."""
        return self._let_go(None)

    def _hold(self, readings: Records, reports: Records) -> None:
        accepted = np.isin(reports["verdict"], APPLIED) & (readings["sensor"] >= 0)
        accepted &= self._moves[np.maximum(readings["sensor"], 0)]
        more = readings[accepted].astype(self._held.dtype)
        if not len(more):
            return
        more["t_ns"] -= self._delay_ns[more["sensor"]]
        self._note(more)
        self._held = np.concatenate([self._held, more])

    def _still_judged_ns(self) -> int:
        """Stamp from which on a fault may still be found to have begun."""
        if not self._window:
            return LATEST_NS
        t_ns = self._held["t_ns"][self._updates[self._held["sensor"]]]
        if len(t_ns) <= self._window:
            return int(t_ns.min(initial=LATEST_NS)) if len(t_ns) else LATEST_NS
        return int(np.sort(t_ns)[-self._window])

    def _note(self, readings: Records) -> None:
        """Remember the newest stamp, and when the last reading that was the newest arrived."""
        t_ns = readings["t_ns"]
        first = int(t_ns[0]) if self._newest_ns is None else self._newest_ns
        so_far = np.maximum.accumulate(np.concatenate([[first], t_ns]))
        self._newest_ns = int(so_far[-1])
        arrived = np.flatnonzero((t_ns >= so_far[:-1]) & (readings["flags"] & HAS_ARRIVAL != 0))
        if len(arrived):
            self._newest_arrival_ns = int(readings["arrival_ns"][arrived[-1]])

    def _jump(self, reading: Any, report: Any) -> Records | Shift:
        before_ns, arrival_ns = self._newest_ns, self._newest_arrival_ns
        sensor = int(reading["sensor"])
        if sensor >= 0:
            self._newest_ns = int(reading["t_ns"]) - int(self._delay_ns[sensor])
        if report["action"] == Action.RESET:
            return self._reset
        assert before_ns is not None
        assert arrival_ns is not None
        assert self._newest_ns is not None
        passed_ns = max(0, int(reading["arrival_ns"]) - arrival_ns)
        return Shift(self._newest_ns - before_ns - passed_ns)

    def _let_go(self, before_ns: int | None) -> Records:
        """Held readings, sorted, all or those older than `before_ns`."""
        held = self._held
        old = np.full(len(held), True) if before_ns is None else held["t_ns"] < before_ns
        self._held, ready = held[~old], held[old]
        values = [ready["z"][:, i] for i in reversed(range(ready["z"].shape[1]))]
        return ready[np.lexsort([*values, ready["seq"], ready["sensor"], ready["t_ns"]])]


def pieces(chunks: Iterable[Records], rows: int = PIECE) -> Iterator[Records]:
    """The same readings in chunks of at most `rows`."""
    for chunk in chunks:
        for begin in range(0, len(chunk), rows):
            yield chunk[begin : begin + rows]
