"""What comes in over the wire, decoded into one batch of readings by the encoding each put declares.

Nothing a sensor sends raises here: what is no reading is counted by reason, per sensor and in all.
"""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.recording.refusals import Refusals
from fusiond.service import reading_json, reading_record
from fusiond.service.reading_batch import ReadingBatch
from fusiond.types import Verdict

TEXT_ENCODINGS = ("application/json", "text/json", "text/plain", "zenoh/string", "zenoh/bytes")
"""Read as JSON: what people's tools set, and what Zenoh sets where they set nothing."""
MOST_BYTES = 1 << 20
"""Longest put that is looked at: 1 MiB, some 25,000 records of two numbers."""
UNKNOWN = -2
"""Route of a key under the sensors' prefix that belongs to no configured sensor."""


class Decoder:
    """Turns puts into a batch.

    Args:
        layout: names and numbers of the sensors.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout
        self.refusals = Refusals()
        self.refused_by_sensor: list[dict[str, int]] = [{} for _ in layout.sensors]
        self.batch = ReadingBatch(layout)

    def begin(self) -> None:
        """Start the next batch; the array of the last one is overwritten."""
        self.batch.clear()

    def readings(self) -> NDArray[Any]:
        """The readings since `begin`, in the order they were added; valid until the next `begin`."""
        return self.batch.view()

    def add(self, sensor: int, arrival_ns: int, encoding: str, payload: bytes) -> None:
        """Decode one put of one sensor (its number, or UNKNOWN)."""
        if sensor == UNKNOWN:
            self.refusals.add(Verdict.UNKNOWN_SENSOR, "a key of no configured sensor")
            return
        if len(payload) > MOST_BYTES:
            refused = [Verdict.MALFORMED]
        elif encoding == reading_record.ENCODING:
            refused = reading_record.decode_records(payload, sensor, arrival_ns, self.batch)
        elif encoding.startswith(TEXT_ENCODINGS):
            refused = reading_json.decode_json(payload, self.layout.sensors[sensor], arrival_ns, self.batch)
        else:
            refused = [Verdict.MALFORMED]
        for verdict in refused:
            self._count(sensor, verdict)

    def _count(self, sensor: int, verdict: Verdict) -> None:
        self.refusals.add(verdict, f"sensor {self.layout.sensors[sensor].name}")
        counts = self.refused_by_sensor[sensor]
        counts[verdict.label] = counts.get(verdict.label, 0) + 1
