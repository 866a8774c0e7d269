"""How a latecomer comes into step: it collects readings, asks for a checkpoint, and adds what is not in it.

A reading reaches both daemons at nearly the same time, but not at the same instant: what the active one takes a little
later than the standby would be missing, were the standby to collect only from the question on. So it collects first.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.records import FED

Readings = NDArray[Any]
COLLECT_NS = 200_000_000
"""How long it collects before it asks: longer than a daemon that keeps up lets a reading wait."""
ANSWER_NS = 1_000_000_000
"""Time after which a checkpoint that has not come is asked for again."""
PAUSE_NS = 2_000_000_000
"""Shortest time from one checkpoint to the next question."""


class CatchUp:
    """Collecting, asking, waiting.

    `due(now)` says when to ask; `note` takes the readings processed meanwhile.
    """

    def __init__(self) -> None:
        self.is_running = False
        self._began_ns = 0
        self._asked_ns: int | None = None
        self._ended_ns: int | None = None
        self._collected: list[Readings] = []

    def begin(self, now_ns: int) -> None:
        """Begin, unless it runs, or ended just now."""
        rested = self._ended_ns is None or now_ns - self._ended_ns >= PAUSE_NS
        if not self.is_running and rested:
            self.is_running, self._began_ns, self._asked_ns = True, now_ns, None
            self._collected = []

    def note(self, readings: Readings) -> None:
        """Keep a copy while it runs."""
        if self.is_running:
            self._collected.append(readings.copy())

    def due(self, now_ns: int) -> bool:
        """Whether to ask now; asks again where no answer came."""
        if not self.is_running or now_ns - self._began_ns < COLLECT_NS:
            return False
        if self._asked_ns is not None and now_ns - self._asked_ns < ANSWER_NS:
            return False
        self._asked_ns = now_ns
        return True

    def end(self, now_ns: int) -> list[Readings]:
        """End; what was collected, in the order taken."""
        collected, self._collected = self._collected, []
        self.is_running, self._ended_ns = False, now_ns
        return collected


def missing(collected: list[Readings], ring: Readings) -> Readings | None:
    """Readings that came after those a checkpoint holds, of each sensor; None where there are none.

    Args:
        ring: the checkpoint's own readings.
    """
    if not collected:
        return None
    readings = np.concatenate(collected)
    held = {_identity(one) for one in ring if not int(one["flags"]) & FED}
    after = dict.fromkeys(readings["sensor"].tolist(), 0)
    for place, one in enumerate(readings):
        if _identity(one) in held:
            after[int(one["sensor"])] = place + 1
    kept = [place >= after[int(one["sensor"])] for place, one in enumerate(readings)]
    found = readings[np.array(kept, np.bool_)]
    return found if len(found) else None


def _identity(reading: Any) -> tuple[int, int, int, bytes]:
    """What makes a reading that reading, wherever it was taken: not its arrival."""
    return int(reading["sensor"]), int(reading["t_ns"]), int(reading["seq"]), reading["z"].tobytes()
