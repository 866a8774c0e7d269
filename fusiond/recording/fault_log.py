"""What was found wrong during a run: faults of every sensor and alarms of the model, from the reports' transitions.

Reports say after every reading what is known to be wrong now. Nearly all of them say what the one before said; only
where their bits differ is one looked at, so that following a run costs a comparison of arrays.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.recording.fault_words import FaultObject, fault_object
from fusiond.types import Kind, Verdict, seconds

MOST = 1000
"""Faults remembered of each sensor, the newest; a summary does not grow with the run."""
WORDS = np.dtype("<u4")


class FaultLog:
    """Follows the reports of one run, block by block, in the order produced."""

    def __init__(self, layout: Layout) -> None:
        self._histories = [History(layout, sensor.number) for sensor in layout.sensors]
        self._alarms: deque[dict[str, Any]] = deque(maxlen=MOST)
        self._model = False
        fields: Any = layout.report.fields
        size, last = WORDS.itemsize, fields["model"]
        self._columns = slice(fields["fault"][1] // size, (last[1] + last[0].itemsize) // size)
        self._width = layout.report.itemsize // size
        self._seen: NDArray[np.uint32] | None = None

    def add(self, reports: NDArray[Any]) -> None:
        """Take one block."""
        words = reports.view(WORDS).reshape(len(reports), self._width)[:, self._columns]
        differs = np.ones(len(words), np.bool_)
        differs[1:] = (words[1:] != words[:-1]).any(axis=1)
        if self._seen is not None:
            differs[0] = bool((words[0] != self._seen).any())
        self._seen = words[-1].copy()
        for k in np.flatnonzero(differs):
            self._observe(reports[k])

    def faults(self, number: int) -> tuple[FaultObject, ...]:
        """Of one sensor, in the order they were found."""
        return tuple(self._histories[number].entries)

    def alarms(self) -> list[dict[str, Any]]:
        """When the model was blamed: `detected_s` and `cleared_s`, null while it still is."""
        return list(self._alarms)

    def _observe(self, report: Any) -> None:
        now_s = seconds(now_ns(report))
        for history in self._histories:
            history.observe(report, now_s)
        model = bool(report["model"])
        if model and not self._model:
            self._alarms.append({"detected_s": now_s, "cleared_s": None})
        elif self._model and not model:
            self._alarms[-1]["cleared_s"] = now_s
        self._model = model


class History:
    """The faults of one sensor.

    A silence stands beside what was known when it began. A decision that names an onset before the last one was made
    revises it (a bias turns out to be a drift); one with a later onset is about another fault.
    """

    def __init__(self, layout: Layout, number: int) -> None:
        self._layout, self._number = layout, number
        self._silence: FaultObject | None = None
        self._fault: FaultObject | None = None
        self._decided_s = 0.0
        self.entries: deque[FaultObject] = deque(maxlen=MOST)

    def observe(self, report: Any, now_s: float) -> None:
        """Take a report in which something may have changed."""
        found = fault_object(self._layout, report, self._number)
        if found is not None and found["kind"] == Kind.SILENT.label:
            if self._silence is None:
                self._silence = self._enter(found, now_s)
            return
        _close(self._silence, now_s)
        self._silence = None
        if found is None:
            _close(self._fault, now_s)
            self._fault = None
            return
        known = self._fault
        if known is not None and all(known[key] == found[key] for key in found):
            return
        if known is not None and found["onset_s"] <= self._decided_s:
            known.update(found)
        else:
            _close(known, now_s)
            self._fault = self._enter(found, now_s)
        self._decided_s = now_s

    def _enter(self, found: FaultObject, now_s: float) -> FaultObject:
        entry = found | {"detected_s": now_s, "cleared_s": None}
        self.entries.append(entry)
        return entry


def _close(entry: FaultObject | None, now_s: float) -> None:
    """The fault is over; there is none from now on."""
    if entry is not None:
        entry["cleared_s"] = now_s


def now_ns(report: Any) -> int:
    """Time of the estimator when it made a report, whose reading may be late, or stamped wrongly."""
    state_t_ns = int(report["state_t_ns"])
    if report["verdict"] == Verdict.FROM_FUTURE:
        return state_t_ns
    return max(int(report["t_ns"]), state_t_ns)
