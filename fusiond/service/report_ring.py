"""The last reports of every sensor, and those around each turn of its health: what `why` answers from.

A fast sensor must not push out a slow one, so each has a ring of its own; and a turn must not be pushed out by the
readings after it, so what led to it is set aside. All of it is bounded: reports are kept as bytes, some hundred each.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.recording.fault_log import now_ns
from fusiond.service.health_watch import Transition

DEPTH = 512
"""Reports kept of each sensor."""
TURNS = 32
"""Turns of its health remembered of each sensor, the newest."""
BEFORE, AFTER = 24, 8
"""Reports set aside at each turn: those that led to it, and some that show what came of it."""


class Turn:
    """One turn: its own report, and those around it."""

    def __init__(self, report: bytes, led_to_it: list[bytes]) -> None:
        self.report = report
        self.around = led_to_it
        self.missing = AFTER


class ReportRing:
    """Keeps reports of one layout; told by the loop, in the order produced."""

    def __init__(self, layout: Layout) -> None:
        self._dtype = layout.report
        self._numbers = layout.numbers
        self._kept: list[deque[bytes]] = [deque(maxlen=DEPTH) for _ in layout.sensors]
        self._turns: list[deque[Turn]] = [deque(maxlen=TURNS) for _ in layout.sensors]
        self._open: list[Turn | None] = [None for _ in layout.sensors]

    def note(self, reports: NDArray[Any], changes: Sequence[Transition]) -> None:
        """Take a batch with the transitions in it; events (ticks, resets) belong to no sensor, but may bring a turn."""
        size, raw = self._dtype.itemsize, reports.tobytes()
        turned = [
            (change.row, self._numbers[change.sensor]) for change in changes if change.sensor is not None
        ]
        for k, number in enumerate(reports["sensor"].tolist()):
            report = raw[k * size : (k + 1) * size]
            if number >= 0:
                self._kept[number].append(report)
                if self._open[number] is not None:
                    self._follow(number, report)
            while turned and turned[0][0] == k:
                self._turn(turned.pop(0)[1], report)

    def turns(self, number: int) -> NDArray[Any]:
        """Reports at which the sensor turned, oldest first."""
        return self._array([turn.report for turn in self._turns[number]])

    def reports(self, number: int) -> NDArray[Any]:
        """All reports kept of a sensor, each once, in the order of the estimator's time."""
        kept = dict.fromkeys(report for turn in self._turns[number] for report in turn.around)
        kept.update(dict.fromkeys(self._kept[number]))
        found = self._array(list(kept))
        return found[np.argsort([now_ns(report) for report in found], kind="stable")]

    def _turn(self, number: int, report: bytes) -> None:
        """A sensor's health or fault has changed with this report, which may be another sensor's, or a tick's."""
        turn = Turn(report, list(self._kept[number])[-BEFORE:])
        self._turns[number].append(turn)
        self._open[number] = turn

    def _follow(self, number: int, report: bytes) -> None:
        turn = self._open[number]
        assert turn is not None
        turn.around.append(report)
        turn.missing -= 1
        if turn.missing == 0:
            self._open[number] = None

    def _array(self, reports: list[bytes]) -> NDArray[Any]:
        return np.frombuffer(b"".join(reports), self._dtype)
