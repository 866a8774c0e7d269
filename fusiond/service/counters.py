"""What became of the readings: verdicts, losses and rates of every sensor."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.engine.records import HAS_SEQ
from fusiond.types import Verdict

VERDICTS = max(Verdict) + 1
REMEMBERED = 4096
"""Open gaps remembered, to tell a late reading from a lost one."""
FAR_BACK = 64
"""A number this far behind the newest, and never missed, is of a sensor that started anew."""
FAR_AHEAD = 1 << 20


class Gaps:
    """Sequence numbers of one sensor that never came."""

    def __init__(self) -> None:
        self.lost = 0
        self._top: int | None = None
        self._open: dict[int, None] = {}

    def note(self, seqs: list[int]) -> None:
        """Take numbers in the order they came."""
        top = self._top
        for seq in seqs:
            if top is None or seq == top + 1 or seq - top > FAR_AHEAD:
                top = seq
            elif seq > top:
                self._miss(top + 1, seq)
                top = seq
            elif seq in self._open:
                del self._open[seq]
                self.lost -= 1
            elif seq == 0 or top - seq >= FAR_BACK:
                top = seq
                self._open.clear()
        self._top = top

    def _miss(self, first: int, end: int) -> None:
        self.lost += end - first
        self._open.update(dict.fromkeys(range(max(first, end - REMEMBERED), end)))
        while len(self._open) > REMEMBERED:
            del self._open[next(iter(self._open))]


class Counters:
    """Counts for all sensors of one layout."""

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.readings = 0
        self.ticks = 0
        self.verdicts = np.zeros((len(layout.sensors), VERDICTS), np.int64)
        self.gaps = [Gaps() for _ in layout.sensors]
        self.rate_hz = np.zeros(len(layout.sensors))
        self._counted = np.zeros(len(layout.sensors), np.int64)
        self._rated_ns: int | None = None

    def note(self, readings: NDArray[Any], reports: NDArray[Any]) -> None:
        """Take one batch, without ticks."""
        count = len(readings)
        self.readings += count
        if count == 1:
            reading = readings[0]
            sensor = int(reading["sensor"])
            self.verdicts[sensor, reports[0]["verdict"]] += 1
            if int(reading["flags"]) & HAS_SEQ:
                self.gaps[sensor].note([int(reading["seq"])])
            return
        sensors = readings["sensor"]
        flat = np.bincount(sensors * VERDICTS + reports["verdict"], minlength=self.verdicts.size)
        self.verdicts += flat.reshape(self.verdicts.shape)
        numbered = (readings["flags"] & HAS_SEQ) != 0
        seqs = readings["seq"]
        for sensor, gaps in enumerate(self.gaps):
            mine = seqs[numbered & (sensors == sensor)]
            if len(mine):
                gaps.note(mine.tolist())

    def rate(self, now_ns: int) -> None:
        """Renew the rates: readings since the last call over the time since."""
        received = self.verdicts.sum(axis=1)
        if self._rated_ns is not None and now_ns > self._rated_ns:
            self.rate_hz = (received - self._counted) * 1e9 / (now_ns - self._rated_ns)
        self._counted, self._rated_ns = received, now_ns

    def of_sensor(self, number: int) -> dict[str, Any]:
        """Counts of one sensor for `status`: used + rejected + late are its readings."""
        row = self.verdicts[number]
        used, late = int(row[Verdict.USED]), int(row[Verdict.TOO_LATE])
        return {
            "rate_hz": round(float(self.rate_hz[number]), 3),
            "used": used,
            "rejected": int(row.sum()) - used - late,
            "late": late,
            "lost": self.gaps[number].lost,
            "verdicts": {verdict.label: int(row[verdict]) for verdict in Verdict if row[verdict]},
        }
