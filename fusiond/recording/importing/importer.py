"""Import of a foreign recording: rows of all its files, merged in the order they were recorded, into one log."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from heapq import merge
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.engine.records import HAS_ARRIVAL, HAS_SEQ
from fusiond.errors import ConfigError, LogError
from fusiond.recording.csv_log import write_csv
from fusiond.recording.decimal_time import seconds_text
from fusiond.recording.importing.mapping import ImportMapping, Source, read_mapping
from fusiond.recording.importing.numbers import Projection, number_of
from fusiond.recording.importing.rows import MissingField, Row
from fusiond.recording.importing.sources import Rows, rows_of
from fusiond.recording.mcap_writer import McapWriter
from fusiond.recording.refusals import Refusals
from fusiond.types import Verdict

CHUNK = 8192


@dataclass(frozen=True, slots=True)
class Imported:
    """What an import wrote.

    Args:
        readings: by sensor.
        truth: rows of the truth CSV, and its path; None where the mapping has none.
        refusals: rows that could not be read.
        t_ns: first and last stamp, None where nothing was read.
    """

    readings: dict[str, int]
    truth: tuple[int, Path] | None
    refusals: Refusals
    t_ns: tuple[int, int] | None


def import_recording(
    src: Path,
    mapping: Path,
    out: Path,
    *,
    json_readings: bool = False,
    progress: Callable[[int], None] | None = None,
) -> Imported:
    """Turn a foreign recording into a log: MCAP, or CSV where OUT ends so.

    Readings are packed: small and fast to replay; `json_readings` adds the same as JSON, for viewers that
    plot. The mapping's truth goes to OUT with `.truth.csv` for its suffix.
    Raises: ConfigError for the mapping's mistakes, LogError for files that cannot be read or written.
    """
    plan = read_mapping(mapping)
    layout = plan.layout(out.stem)
    reader = Reader(src, plan, Refusals(), Projection(plan.origin_deg))
    try:
        if out.suffix == ".csv":
            write_csv(out, layout, reader.chunks(layout, progress))
        else:
            with McapWriter(out, layout, json_readings=json_readings) as writer:
                for chunk in reader.chunks(layout, progress):
                    writer.readings(chunk)
        truth = write_truth(src, plan, out, reader.projection, reader.refusals) if plan.truth else None
    except OSError as error:
        raise LogError(f"{out}: cannot be written ({error.strerror}); name a writable place") from error
    return Imported(reader.counts, truth, reader.refusals, reader.t_ns)


@dataclass(slots=True)
class Reader:
    """The readings of a foreign recording, in arrival order."""

    src: Path
    plan: ImportMapping
    refusals: Refusals
    projection: Projection
    counts: dict[str, int] = field(default_factory=dict)
    t_ns: tuple[int, int] | None = None

    def merged(self) -> Iterator[tuple[int, Source, RowReading]]:
        """Readings of all files with their source, merged by the first element."""
        streams = [self._stream(rows) for rows in rows_of(self.src, self.plan.sensors)]
        return merge(*streams, key=lambda item: item[0])

    def chunks(self, layout: Layout, progress: Callable[[int], None] | None) -> Iterator[NDArray[Any]]:
        """Arrays of the layout's readings."""
        self.counts = dict.fromkeys(layout.numbers, 0)
        out, kept = np.zeros(CHUNK, layout.reading), 0
        for _, source, reading in self.merged():
            fill(out[kept], layout.numbers[source.name], reading)
            self.counts[source.name] += 1
            first, last = self.t_ns or (reading.t_ns, reading.t_ns)
            self.t_ns = (min(first, reading.t_ns), max(last, reading.t_ns))
            kept += 1
            if kept == CHUNK:
                yield out
                if progress is not None:
                    progress(sum(self.counts.values()))
                out, kept = np.zeros(CHUNK, layout.reading), 0
        if kept:
            yield out[:kept]

    def _stream(self, rows: Rows) -> Iterator[tuple[int, Source, RowReading]]:
        """Readings of one file with the key that merges it with others: never decreasing, so file order
        stays.
        """
        latest = -(2**63)
        before: dict[str, tuple[float, ...]] = {}
        seen: set[str] = set()
        for number, (row, sources) in enumerate(rows, 1):
            for reading, source in readings_of(row, number, sources, self.projection, self.refusals, seen):
                if source.on_change:
                    if before.get(source.name) == reading.z:
                        continue
                    before[source.name] = reading.z
                latest = max(latest, reading.t_ns if reading.arrival_ns is None else reading.arrival_ns)
                yield latest, source, reading


@dataclass(frozen=True, slots=True)
class RowReading:
    """One reading on its way into a log."""

    t_ns: int
    arrival_ns: int | None
    seq: int | None
    z: tuple[float, ...]


def readings_of(
    row: Row,
    number: int,
    sources: Sequence[Source],
    projection: Projection,
    refusals: Refusals,
    seen: set[str],
) -> Iterator[tuple[RowReading, Source]]:
    """The readings of one row.

    A field that is missing in a source's first row is the mapping's mistake (ConfigError), later the
    recording's: counted.
    """
    for source in sources:
        try:
            where = source.place.where
            if where is not None and row.text(where[0]) != where[1]:
                continue
            reading = reading_of(row, source, projection)
        except MissingField as error:
            if source.name not in seen:
                raise ConfigError(
                    f"sensor.{source.name}: the recording {error}; correct the mapping"
                ) from error
            refusals.add(Verdict.MALFORMED, f"row {number}, {source.name}: {error}")
        except (ValueError, OverflowError) as error:
            refusals.add(Verdict.MALFORMED, f"row {number}, {source.name}: {error}")
        else:
            seen.add(source.name)
            yield reading, source


def reading_of(row: Row, source: Source, projection: Projection) -> RowReading:
    """One reading. Raises: MissingField; ValueError where a number is none."""
    arrival_ns = None if source.arrival is None else row.time_ns(source.arrival, source.arrival_unit)
    seq = None if source.seq is None else int(row.text(source.seq))
    z = tuple(number_of(value, row, projection) for value in source.values)
    return RowReading(row.time_ns(source.time, source.time_unit), arrival_ns, seq, z)


def fill(out: Any, sensor: int, reading: RowReading) -> None:
    """Fill one zeroed record."""
    out["t_ns"] = reading.t_ns
    out["sensor"] = sensor
    out["length"] = len(reading.z)
    out["z"][: len(reading.z)] = reading.z
    flags = 0
    if reading.arrival_ns is not None:
        out["arrival_ns"] = reading.arrival_ns
        flags |= HAS_ARRIVAL
    if reading.seq is not None:
        out["seq"] = reading.seq
        flags |= HAS_SEQ
    out["flags"] = flags


def write_truth(
    src: Path, plan: ImportMapping, out: Path, projection: Projection, refusals: Refusals
) -> tuple[int, Path]:
    """The mapping's truth as a CSV beside the log; rows that go back in time are counted and left out."""
    path = out.with_suffix(".truth.csv")
    rows, latest = 0, -(2**63)
    truth = Reader(
        src, ImportMapping(plan.truth, (), plan.origin_deg), refusals=refusals, projection=projection
    )
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["t_s", *(value.name for value in plan.truth[0].values)])
        for _, _, reading in truth.merged():
            if reading.t_ns <= latest:
                refusals.add(
                    Verdict.MALFORMED,
                    f"truth at {seconds_text(reading.t_ns)} s: not later than the row before",
                )
                continue
            latest = reading.t_ns
            writer.writerow([seconds_text(reading.t_ns), *map(repr, reading.z)])
            rows += 1
    return rows, path
