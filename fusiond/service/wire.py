"""What comes in over the wire, decoded into one batch of readings by the encoding each put declares.

Nothing a sensor sends raises here: what is no reading is counted by reason, per sensor and in all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import zenoh
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.recording.refusals import Refusals
from fusiond.service import reading_json, reading_record
from fusiond.service.reading_batch import ReadingBatch
from fusiond.types import Verdict

TEXT_ENCODINGS = ("application/json", "text/json", "text/plain", "zenoh/string", "zenoh/bytes")
"""Read as JSON: what people's tools set, and what Zenoh sets where they set nothing."""
RECORD = zenoh.Encoding(reading_record.ENCODING)
MOST_BYTES = 1 << 20
"""Longest put that is looked at: 1 MiB, some 25,000 records of two numbers."""
UNKNOWN = -2
"""Number of a key under the sensors' prefix that belongs to no configured sensor."""
IGNORED = -3
"""Number of a key that another subscription already delivers."""


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
        self._run_sensor = UNKNOWN
        self._run_length = -1
        self._run: list[bytes] = []
        self._run_arrivals_ns: list[int] = []

    def begin(self) -> None:
        """Start the next batch; the array of the last one is overwritten."""
        self.batch.clear()

    def readings(self) -> NDArray[Any]:
        """The readings since `begin`, in the order they were added; valid until the next `begin`."""
        if self._run:
            self._end_run()
        return self.batch.view()

    def add(self, sensor: int, arrival_ns: int, encoding: str, payload: bytes) -> None:
        """Decode one put of one sensor (its number, or UNKNOWN)."""
        if sensor == UNKNOWN:
            self._unknown()
        elif encoding == reading_record.ENCODING and len(payload) <= MOST_BYTES:
            if self._run and (sensor != self._run_sensor or len(payload) != self._run_length):
                self._end_run()
            self._run_sensor, self._run_length = sensor, len(payload)
            self._run.append(payload)
            self._run_arrivals_ns.append(arrival_ns)
        else:
            if self._run:
                self._end_run()
            why = self._text(sensor, arrival_ns, encoding, payload)
            self._count(sensor, [Verdict.MALFORMED] * len(why), *why[:1])

    def add_record(self, sensor: int, arrival_ns: int, payload: bytes) -> None:
        """Decode one put of records that stands alone: nothing behind it is worth waiting for."""
        if sensor == UNKNOWN:
            self._unknown()
        elif len(payload) > MOST_BYTES:
            self._count(sensor, [Verdict.MALFORMED])
        elif refused := reading_record.decode_records(payload, sensor, arrival_ns, self.batch):
            self._count(sensor, refused)

    def _text(self, sensor: int, arrival_ns: int, encoding: str, payload: bytes) -> list[str]:
        """Decode what is no record, if it is JSON; why, for everything refused."""
        if len(payload) > MOST_BYTES:
            return [f"{len(payload)} bytes (limit {MOST_BYTES})"]
        if not encoding.startswith(TEXT_ENCODINGS):
            return [f"encoding {encoding}"]
        return reading_json.decode_json(payload, self.layout.sensors[sensor], arrival_ns, self.batch)

    def _end_run(self) -> None:
        """Decode the records held back: puts of one sensor and length, one after the other."""
        sensor = self._run_sensor
        self._count(sensor, reading_record.decode_puts(self._run, sensor, self._run_arrivals_ns, self.batch))
        self._run.clear()
        self._run_arrivals_ns.clear()

    def _unknown(self) -> None:
        self.refusals.add(Verdict.UNKNOWN_SENSOR, "a key of no configured sensor")

    def _count(self, sensor: int, refused: list[Verdict], why: str = "") -> None:
        for verdict in refused:
            who = f"sensor {self.layout.sensors[sensor].name}"
            self.refusals.add(verdict, f"{who} ({why})" if why else who)
            counts = self.refused_by_sensor[sensor]
            counts[verdict.label] = counts.get(verdict.label, 0) + 1


def take(
    arrivals: Sequence[tuple[int, int, Any]], sensor_of: Callable[[int, Any], int], decoder: Decoder
) -> NDArray[Any]:
    """The readings of arrivals, in their order; valid until the next call.

    Args:
        arrivals: arrival in ns, route, Zenoh sample.
        sensor_of: sensor number, UNKNOWN or IGNORED of (route, sample).
    """
    decoder.begin()
    alone = len(arrivals) == 1
    for arrival_ns, route, sample in arrivals:
        sensor = sensor_of(route, sample)
        if sensor == IGNORED:
            continue
        # Comparing encodings is cheaper than writing one out.
        if alone and sample.encoding == RECORD:
            decoder.add_record(sensor, arrival_ns, sample.payload.to_bytes())
        else:
            decoder.add(sensor, arrival_ns, str(sample.encoding), sample.payload.to_bytes())
    return decoder.readings()
