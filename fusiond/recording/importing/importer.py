"""Import of a foreign recording: rows of all its files, merged in the order they were recorded, into one log."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from heapq import merge
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.engine.records import HAS_ARRIVAL, HAS_SEQ
from fusiond.errors import ConfigError, LogError
from fusiond.recording.csv_writer import write_csv
from fusiond.recording.decimal_time import seconds_text
from fusiond.recording.importing.mapping import ATTITUDE, Source, read_mapping
from fusiond.recording.importing.numbers import Frames, number_of
from fusiond.recording.importing.rows import MissingField, Row
from fusiond.recording.importing.sources import Rows, rows_of
from fusiond.recording.mcap_writer import McapWriter
from fusiond.recording.refusals import Refusals
from fusiond.types import NANOSECONDS, Verdict

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
    if not src.exists():
        raise LogError(f"{src}: is not there; name an existing recording")
    layout = plan.layout(out.stem)
    attitude = () if plan.attitude is None else (plan.attitude,)
    reader = Reader(src, (*attitude, *plan.sensors), Frames(plan.origin_deg), Refusals())
    try:
        if out.suffix == ".csv":
            write_csv(out, layout, reader.chunks(layout, progress))
        else:
            with McapWriter(out, layout, json_readings=json_readings) as writer:
                for chunk in reader.chunks(layout, progress):
                    writer.readings(chunk)
        truth = write_truth(src, plan.truth, out, reader.frames, reader.refusals) if plan.truth else None
    except OSError as error:
        raise LogError(f"{out}: cannot be written ({error.strerror}); name a writable place") from error
    return Imported(reader.counts, truth, reader.refusals, reader.t_ns)


@dataclass(frozen=True, slots=True)
class RowReading:
    """One reading on its way into a log."""

    t_ns: int
    arrival_ns: int | None
    seq: int | None
    z: tuple[float, ...]


@dataclass(slots=True)
class Reader:
    """The readings of a foreign recording, in arrival order.

    A field that is missing in a sensor's first row is the mapping's mistake (ConfigError), later the
    recording's: counted.
    """

    src: Path
    sources: tuple[Source, ...]
    frames: Frames
    refusals: Refusals
    counts: dict[str, int] = field(default_factory=dict)
    t_ns: tuple[int, int] | None = None
    _seen: set[str] = field(default_factory=set)
    _before: dict[str, tuple[float, ...]] = field(default_factory=dict)
    _first: dict[str, tuple[int, int]] = field(default_factory=dict)
    _latest: dict[str, int] = field(default_factory=dict)

    def readings(self) -> Iterator[tuple[Source, RowReading]]:
        """Readings of all files with their source, merged by arrival (by stamp where the mapping names no
        arrival).
        """
        streams = [self._stream(rows) for rows in rows_of(self.src, self.sources)]
        for _, number, source, row in merge(*streams, key=lambda item: item[0]):
            try:
                if source.name == ATTITUDE:
                    x, y, z, w = (row.number(field) for field in source.values[0].fields)
                    self.frames.attitude = (x, y, z, w)
                    continue
                t_ns = self._stamp_ns(row, number, source)
                since = self._since_s(source, t_ns)
                reading = reading_of(row, source, self.frames, t_ns, since)
            except (MissingField, ValueError, OverflowError) as error:
                self._refuse(error, number, source)
                continue
            finally:
                self._seen.add(source.name)
            if since is None:
                continue
            if source.on_change:
                if self._before.get(source.name) == reading.z:
                    continue
                self._before[source.name] = reading.z
            yield source, reading

    def chunks(self, layout: Layout, progress: Callable[[int], None] | None) -> Iterator[NDArray[Any]]:
        """Arrays of the layout's readings."""
        self.counts = dict.fromkeys(layout.numbers, 0)
        out, kept = np.zeros(CHUNK, layout.reading), 0
        for source, reading in self.readings():
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

    def _stream(self, rows: Rows) -> Iterator[tuple[int, int, Source, Row]]:
        """Rows of one file under a key that merges it with others: never decreasing, so the file's order
        stays.
        """
        latest = -(2**63)
        for number, (row, sources) in enumerate(rows, 1):
            for source in sources:
                try:
                    where = source.place.where
                    if where is not None and row.text(where[0]) != where[1]:
                        continue
                    latest = max(latest, recorded_ns(row, source))
                except (MissingField, ValueError, OverflowError) as error:
                    self._refuse(error, number, source)
                    continue
                yield latest, number, source, row

    def _stamp_ns(self, row: Row, number: int, source: Source) -> int:
        """The row's own time, or the steady clock's that began with the source's first row."""
        t_ns = row.time_ns(source.time, source.time_unit)
        if not source.every_ns:
            return t_ns
        first, first_ns = self._first.setdefault(source.name, (number, t_ns))
        return first_ns + (number - first) * source.every_ns

    def _since_s(self, source: Source, t_ns: int) -> float | None:
        """Seconds since the source's row before, 1 where none of its values is a gain; None for its first row.

        Raises: ValueError where the row is not later than the one before.
        """
        if not any(value.per_s for value in source.values):
            return 1.0
        before_ns = self._latest.get(source.name)
        if before_ns is not None and t_ns <= before_ns:
            raise ValueError("is not later than the row before, so that its gain has no rate")
        self._latest[source.name] = t_ns
        return None if before_ns is None else (t_ns - before_ns) / NANOSECONDS

    def _refuse(self, error: Exception, number: int, source: Source) -> None:
        if isinstance(error, MissingField) and source.name not in self._seen:
            raise ConfigError(f"sensor.{source.name}: the recording {error}; correct the mapping") from error
        self.refusals.add(Verdict.MALFORMED, f"row {number}, {source.name}: {error}")


def recorded_ns(row: Row, source: Source) -> int:
    """When a row was recorded: its arrival where the mapping names one, otherwise its stamp."""
    if source.arrival is None:
        return row.time_ns(source.time, source.time_unit)
    return row.time_ns(source.arrival, source.arrival_unit)


def reading_of(row: Row, source: Source, frames: Frames, t_ns: int, since_s: float | None) -> RowReading:
    """One reading, stamped t_ns. Raises: MissingField; ValueError where a number is none.

    Args:
        since_s: time since the row before, by which gains are divided.
    """
    arrival_ns = None if source.arrival is None else row.time_ns(source.arrival, source.arrival_unit)
    seq = None if source.seq is None else int(row.text(source.seq))
    gained_in_s = since_s or 1.0
    z = tuple(number_of(v, row, frames) / (gained_in_s if v.per_s else 1.0) for v in source.values)
    return RowReading(t_ns, arrival_ns, seq, z)


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
    src: Path, truth: tuple[Source, ...], out: Path, frames: Frames, refusals: Refusals
) -> tuple[int, Path]:
    """The mapping's truth as a CSV beside the log; rows that are not later than the one before are counted
    and left out.
    """
    path = out.with_suffix(".truth.csv")
    rows, latest = 0, -(2**63)
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["t_s", *(value.name for value in truth[0].values)])
        for _, reading in Reader(src, truth, frames, refusals).readings():
            at = seconds_text(reading.t_ns)
            if reading.t_ns <= latest:
                refusals.add(Verdict.MALFORMED, f"truth at {at} s: not later than the row before")
                continue
            latest = reading.t_ns
            writer.writerow([at, *map(repr, reading.z)])
            rows += 1
    return rows, path
