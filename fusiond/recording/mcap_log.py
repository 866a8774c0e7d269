"""Reading a recording back as a log: arrays of readings in the order they arrived."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Channel, Message
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.errors import LogError
from fusiond.recording.description import Description, description_of
from fusiond.recording.mcap_blocks import McapFile
from fusiond.recording.reading_json import fill_reading
from fusiond.recording.refusals import Refusals
from fusiond.types import EVENTS, Verdict

CHUNK = 8192
UNKNOWN = min(EVENTS) - 1
NUMBERS = {name: event for event, name in EVENTS.items()}


class McapLog:
    """A recording as an iterable of reading arrays, in the order written; may be iterated again.

    Packed readings are taken where the recording has them, otherwise its JSON channels `sensor/NAME` (also
    under a namespace, `any/sensor/NAME`). Sensors are matched by name, so the replaying configuration may
    number them otherwise; what it does not have is counted as unknown.
    """

    def __init__(self, path: Path, layout: Layout) -> None:
        self.path = path
        self.layout = layout
        self.refusals = Refusals()
        self._file = McapFile(path, warnings=self.refusals.notes)
        head = self._file.head()
        self.config_text = head.get("config", "")
        self.known_noise: dict[str, Any] = json.loads(head.get("noise", "{}"))
        self._packed = "packed" in head.get("readings", "").split(",")
        self._ours = bool(head)
        self.description: Description | None = None
        if head:
            try:
                self.description = description_of(head["layout"])
            except (KeyError, TypeError, ValueError) as error:
                raise LogError(
                    f"{path.name}: its metadata is not what fusiond writes ({error}); record or import it again"
                ) from error

    @property
    def warnings(self) -> list[str]:
        """What was wrong with the file as a whole, as far as it was read."""
        return self.refusals.notes

    def __iter__(self) -> Iterator[NDArray[Any]]:
        self.refusals.clear()
        chunks = self._packed_chunks() if self._packed else self._json_chunks()
        yield from (readings for readings in chunks if len(readings))
        lost = self._file.metadata.get("fusiond.end", {}).get("dropped_readings", "0")
        if lost != "0":
            self.refusals.notes.append(
                f"{self.path.name}: {lost} readings were lost while it was recorded; a replay differs from that run"
            )

    def _packed_chunks(self) -> Iterator[NDArray[Any]]:
        translate, names = self._translation()
        for whole in self._file.blocks("readings"):
            block = whole
            numbers = translate[np.clip(block["sensor"], UNKNOWN, len(translate) + UNKNOWN - 1) - UNKNOWN]
            keep = numbers != UNKNOWN
            if not keep.all():
                self._refuse(block, keep, names)
                block, numbers = block[keep], numbers[keep]
            yield self._fit(block, numbers)

    def _translation(self) -> tuple[NDArray[np.int32], dict[int, str]]:
        """Our sensor number for each of the recording's, shifted so that events and unknown ones have a place."""
        assert self.description is not None
        names = {sensor.number: sensor.name for sensor in self.description.sensors}
        table = np.full(len(names) - UNKNOWN, UNKNOWN, np.int32)
        for event in EVENTS:
            table[event - UNKNOWN] = event
        for number, name in names.items():
            table[number - UNKNOWN] = self.layout.numbers.get(name, UNKNOWN)
        return table, names

    def _refuse(self, block: NDArray[Any], keep: NDArray[np.bool_], names: dict[int, str]) -> None:
        number = int(block["sensor"][np.argmin(keep)])
        where = f"{self.path.name} message {self._file.messages}: sensor {names.get(number, str(number))!r}"
        self.refusals.add(Verdict.UNKNOWN_SENSOR, where, int(np.sum(~keep)))

    def _fit(self, block: NDArray[Any], numbers: NDArray[np.int32]) -> NDArray[Any]:
        """The block as a fresh array of our dtype; a wider payload is cut, `length` keeps what was sent."""
        if block.dtype == self.layout.reading:
            out = block.copy()
        else:
            out = np.zeros(len(block), self.layout.reading)
            held = min(block["z"].shape[1], out["z"].shape[1])
            for field in ("t_ns", "arrival_ns", "seq", "length", "flags"):
                out[field] = block[field]
            out["z"][:, :held] = block["z"][:, :held]
            out["R"][:, :held, :held] = block["R"][:, :held, :held]
        out["sensor"] = numbers
        return out

    def _json_chunks(self) -> Iterator[NDArray[Any]]:
        out = np.zeros(CHUNK, self.layout.reading)
        kept = 0
        for channel, message in self._file.walk():
            name = sensor_of(channel)
            if name is None:
                continue
            if self._message(out[kept], name, message):
                kept += 1
            else:
                out[kept : kept + 1] = np.zeros(1, out.dtype)
            if kept == CHUNK:
                yield out
                out, kept = np.zeros(CHUNK, self.layout.reading), 0
        yield out[:kept]

    def _message(self, out: Any, name: str, message: Message) -> bool:
        """Fill one zeroed reading; whether it is one, otherwise it was counted and may be half filled."""
        number = NUMBERS.get(name, self.layout.numbers.get(name))
        where = f"{self.path.name} message {self._file.messages}"
        if number is None:
            self.refusals.add(Verdict.UNKNOWN_SENSOR, f"{where}: sensor {name!r}")
            return False
        try:
            fill_reading(out, message.data, message.log_time, not self._ours)
        except (KeyError, TypeError, ValueError, OverflowError, AttributeError) as error:
            self.refusals.add(Verdict.MALFORMED, f"{where}: {name}: {error!r}")
            return False
        out["sensor"] = number
        return True


def sensor_of(channel: Channel) -> str | None:
    """The sensor whose readings a JSON channel carries, the event's name for events, None for any other channel."""
    if channel.message_encoding != "json":
        return None
    if channel.topic in NUMBERS:
        return channel.topic
    head, found, name = channel.topic.rpartition("sensor/")
    return name if found and (not head or head.endswith("/")) else None
