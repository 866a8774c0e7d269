"""What became of the readings: verdicts, losses and rates of every sensor."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.engine.records import HAS_SEQ
from fusiond.service.report_rows import fields_struct
from fusiond.types import Verdict

VERDICTS = max(Verdict) + 1
REMEMBERED = 4096
"""Open gaps remembered, to tell a late reading from a lost one."""
FAR_BACK = 64
"""A number this far behind the newest, and never missed, is of a sensor that started anew."""
FAR_AHEAD = 1 << 20
SHORTEST_RATE_NS = 500_000_000
"""A rate over less time would be that of a burst or a pause."""


class Gaps:
    """Sequence numbers of one sensor that never came."""

    def __init__(self) -> None:
        self.lost = 0
        self._top: int | None = None
        self._open: dict[int, None] = {}

    def note(self, seq: int) -> None:
        """Take the next number, in the order they came."""
        top = self._top
        if top is None or seq == top + 1 or seq - top > FAR_AHEAD:
            self._top = seq
        elif seq > top:
            self._miss(top + 1, seq)
            self._top = seq
        elif seq in self._open:
            del self._open[seq]
            self.lost -= 1
        elif top - seq >= FAR_BACK:
            self._top = seq
            self._open.clear()

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
        self.verdicts = [[0] * VERDICTS for _ in layout.sensors]
        self.gaps = [Gaps() for _ in layout.sensors]
        self.rate_hz = [0.0] * len(layout.sensors)
        self._rows = fields_struct(layout.reading, ("seq", "sensor", "flags"), whole=True)
        self._counted = [0] * len(layout.sensors)
        self._rated_ns: int | None = None

    def note(self, readings: NDArray[Any], reports: NDArray[Any]) -> None:
        """Take one batch, without ticks."""
        self.readings += len(readings)
        rows = zip(self._rows.iter_unpack(readings.data), reports["verdict"].tolist(), strict=True)
        for (seq, sensor, flags), verdict in rows:
            self.verdicts[sensor][verdict] += 1
            if flags & HAS_SEQ:
                self.gaps[sensor].note(seq)

    def rate(self, now_ns: int) -> None:
        """Renew the rates: readings since they were last renewed over the time since, if that is long enough."""
        if self._rated_ns is not None and 0 <= now_ns - self._rated_ns < SHORTEST_RATE_NS:
            return
        received = [sum(row) for row in self.verdicts]
        if self._rated_ns is not None and now_ns > self._rated_ns:
            per_s = 1e9 / (now_ns - self._rated_ns)
            self.rate_hz = [(new - old) * per_s for new, old in zip(received, self._counted, strict=True)]
        self._counted, self._rated_ns = received, now_ns

    def heard(self, number: int) -> bool:
        """Whether any reading of a sensor came, used or not."""
        return any(self.verdicts[number])

    def of_sensor(self, number: int) -> dict[str, Any]:
        """Counts of one sensor for `status`: used + rejected + late are its readings."""
        row = self.verdicts[number]
        used, late = row[Verdict.USED], row[Verdict.TOO_LATE]
        return {
            "rate_hz": round(self.rate_hz[number], 3),
            "used": used,
            "rejected": sum(row) - used - late,
            "late": late,
            "lost": self.gaps[number].lost,
            "verdicts": {verdict.label: row[verdict] for verdict in Verdict if row[verdict]},
        }
