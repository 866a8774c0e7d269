"""Writing a recording: one MCAP file with packed records for replay and JSON channels for people and viewers.

| what | where |
|---|---|
| configuration, version, names and units | metadata record `fusiond` |
| readings and events in arrival order | packed channel `readings`, and on wish JSON channels `sensor/NAME`,
`tick`, `reset` |
| reports in the order produced | packed channel `reports` |
| what was published | JSON channels `estimate`, `control`, `health`, `event` |
| how the recording ended | metadata record `fusiond.end`, absent after a crash |

A packed message is a block of records one after the other; its channel's metadata has their dtype. `log_time`
is the arrival where it was measured, otherwise the stamp; `publish_time` is the stamp (both 0 where
negative).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from fusiond import __version__
from fusiond.engine.layout import Layout
from fusiond.engine.records import HAS_ARRIVAL
from fusiond.errors import LogError
from fusiond.recording.description import describe, dtype_text
from fusiond.recording.reading_json import reading_json
from fusiond.recording.schemas import schema_name, schema_text
from fusiond.types import EVENTS

ENCODING = "fusiond.records"
"""Message encoding of the packed channels."""
BLOCK = 8192
"""Most records in one packed message."""


def keep_existing(path: Path) -> Path | None:
    """Move an existing file out of the way, to `NAME-1.mcap` or the next free number; returns where to."""
    if not path.exists():
        return None
    number = 1
    while (aside := path.with_name(f"{path.stem}-{number}{path.suffix}")).exists():
        number += 1
    path.rename(aside)
    return aside


class McapWriter:
    """Writes one recording; a context manager.

    Args:
        path: file to write; an existing one is replaced.
        layout: names, units and dtypes.
        config_text: the configuration the run has, as TOML; empty for an imported recording.
        packed, json_readings: which forms the readings get; at least one.
        known_noise: what the run knew of the sensors' noise before its first reading (`engine.noise_learnt`).
    Raises: LogError where the file cannot be written.
    """

    def __init__(
        self,
        path: Path,
        layout: Layout,
        config_text: str = "",
        *,
        packed: bool = True,
        json_readings: bool = False,
        known_noise: Mapping[str, Any] | None = None,
    ) -> None:
        if not (packed or json_readings):
            raise ValueError("a recording without readings cannot be replayed")
        self.path = path
        self.layout = layout
        self.counts: dict[str, int] = {"readings": 0, "events": 0, "reports": 0, "messages": 0}
        self._packed, self._json = packed, json_readings
        self._topics = {s.number: f"sensor/{s.name}" for s in layout.sensors} | EVENTS
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        try:
            self._file = path.open("wb")
        except OSError as error:
            raise LogError(f"{path}: cannot be written ({error.strerror}); name a writable place") from error
        self._writer = Writer(self._file, compression=CompressionType.ZSTD)
        self._writer.start(profile="", library=f"fusiond {__version__}")
        forms = [form for form, wanted in (("packed", packed), ("json", json_readings)) if wanted]
        self._writer.add_metadata(
            "fusiond",
            {
                "version": __version__,
                "config": config_text,
                "layout": describe(layout),
                "readings": ",".join(forms),
                **({"noise": json.dumps(known_noise)} if known_noise else {}),
            },
        )
        self._file.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def readings(self, block: NDArray[Any]) -> None:
        """Append readings and events, in arrival order."""
        events = int(np.count_nonzero(block["sensor"] < 0))
        self.counts["events"] += events
        self.counts["readings"] += len(block) - events
        if self._packed:
            self._blocks("readings", block)
        if self._json:
            for reading in block:
                topic = self._topics[int(reading["sensor"])]
                self._add(
                    self._json_channel(topic), log_time_of(reading), reading["t_ns"], reading_json(reading)
                )

    def reports(self, block: NDArray[Any]) -> None:
        """Append reports, in the order produced."""
        self.counts["reports"] += len(block)
        self._blocks("reports", block)

    def message(self, topic: str, payload: bytes | Mapping[str, Any], t_ns: int, log_time_ns: int) -> None:
        """Append one published JSON message: `estimate`, `control`, `health` or `event`."""
        data = payload if isinstance(payload, bytes) else json.dumps(payload).encode()
        self.counts["messages"] += 1
        self._add(self._json_channel(topic), log_time_ns, t_ns, data)

    def flush(self) -> None:
        """Close the chunk in progress and hand everything to the operating system: a crash now loses nothing."""
        self._writer.flush()

    def close(self, **facts: int | str) -> None:
        """Finish the file; `facts` (what was dropped, why it ended) go into its metadata beside the counts."""
        if self._file.closed:
            return
        end = {name: str(value) for name, value in (self.counts | facts).items()}
        try:
            self._writer.flush()
            self._writer.add_metadata("fusiond.end", end)
            self._writer.finish()
        finally:
            self._file.close()

    def _blocks(self, topic: str, block: NDArray[Any]) -> None:
        for start in range(0, len(block), BLOCK):
            part = block[start : start + BLOCK]
            channel = self._packed_channel(topic, part.dtype)
            self._add(channel, log_time_of(part[-1]), part["t_ns"][-1], part.tobytes())

    def _add(self, channel: int, log_time_ns: int, publish_time_ns: int, data: bytes) -> None:
        log_time, publish_time = max(0, int(log_time_ns)), max(0, int(publish_time_ns))
        self._writer.add_message(channel, log_time=log_time, publish_time=publish_time, data=data)

    def _packed_channel(self, topic: str, dtype: np.dtype[Any]) -> int:
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(
                topic, ENCODING, schema_id=0, metadata={"dtype": dtype_text(dtype)}
            )
        return self._channels[topic]

    def _json_channel(self, topic: str) -> int:
        if topic not in self._channels:
            name = schema_name(topic)
            if name not in self._schemas:
                self._schemas[name] = self._writer.register_schema(name, "jsonschema", schema_text(name))
            self._channels[topic] = self._writer.register_channel(topic, "json", self._schemas[name])
        return self._channels[topic]


def log_time_of(record: Any) -> int:
    """Arrival of a reading where it was measured (for a report: where it is not 0), otherwise its stamp."""
    arrival = int(record["arrival_ns"])
    names = record.dtype.names
    measured = bool(int(record["flags"]) & HAS_ARRIVAL) if "flags" in names else arrival != 0
    return arrival if measured else int(record["t_ns"])
