"""The CSV log: `t_s,sensor,z0,z1,...` with optional columns `arrival_s` and `seq`, rows in arrival order.

A row whose sensor is `tick` is time passing, `reset` an operator's reset (unless a sensor has that name). Trailing
cells may be missing: the reading is then shorter. What cannot be parsed is counted, never raised; only a wrong header
is an error.
"""

from __future__ import annotations

import gzip
import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.engine.records import HAS_ARRIVAL, HAS_SEQ
from fusiond.errors import LogError
from fusiond.recording.decimal_time import NUMBER, nanoseconds_column, nanoseconds_of
from fusiond.recording.refusals import Refusals
from fusiond.types import EVENTS, Verdict

BLOCK = 1 << 19
"""Characters read at once: some 15,000 rows."""
FEW = 32
"""Lines that are read one by one where there is something wrong among them."""
UNKNOWN = min(EVENTS) - 1
SPECIAL = re.compile(r"[+-]?(?:nan|inf(?:inity)?)", re.IGNORECASE)
HEADER = "t_s,sensor,z0,z1,... with optional arrival_s and seq"


@dataclass(frozen=True, slots=True)
class Columns:
    """Where each column stands; -1 where the file has none."""

    t: int
    sensor: int
    arrival: int
    seq: int
    z: tuple[int, ...]
    count: int


def columns_of(header: str, path: Path) -> Columns:
    """Read the header line. Raises: LogError where it is no log's header."""
    names = [name.strip() for name in header.strip().split(",")]
    z = tuple(f"z{k}" for k in range(sum(re.fullmatch(r"z\d+", name) is not None for name in names)))
    known = {"t_s", "sensor", "arrival_s", "seq", *z}
    missing = [name for name in ("t_s", "sensor", *z) if name not in names]
    odd = [name for name in names if name not in known]
    if missing or odd or len(set(names)) != len(names):
        fact = f"misses {', '.join(missing)}" if missing else f"has {', '.join(odd) or 'a column twice'}"
        raise LogError(
            f"{path.name}: the header {fact}; write {HEADER}, or turn the file into a log with `fusiond import`"
        )
    at = {name: index for index, name in enumerate(names)}
    return Columns(
        at["t_s"],
        at["sensor"],
        at.get("arrival_s", -1),
        at.get("seq", -1),
        tuple(at[name] for name in z),
        len(names),
    )


class CsvLog:
    """A CSV log as an iterable of reading arrays, in the order of its rows; may be iterated again.

    Args:
        path: the file, also gzipped.
        layout: gives sensor numbers and the dtype of the arrays.
    """

    def __init__(self, path: Path, layout: Layout) -> None:
        self.path = path
        self.layout = layout
        self.refusals = Refusals()
        self._numbers = {name: event for event, name in EVENTS.items()} | layout.numbers
        with self._open() as file:
            self._columns = columns_of(file.readline(), path)

    @property
    def warnings(self) -> list[str]:
        """What was wrong with the file as a whole, as far as it was read."""
        return self.refusals.notes

    def _open(self) -> TextIO:
        try:
            with self.path.open("rb") as raw:
                packed = raw.read(2) == b"\x1f\x8b"
            if packed:
                return gzip.open(self.path, "rt", encoding="utf-8-sig", errors="replace")
            return self.path.open("rt", encoding="utf-8-sig", errors="replace")
        except OSError as error:
            raise LogError(f"{self.path}: cannot be read ({error.strerror}); name an existing log") from error

    def __iter__(self) -> Iterator[NDArray[Any]]:
        self.refusals.clear()
        with self._open() as file:
            file.readline()
            for line_number, lines in self._blocks(file):
                yield from (readings for readings in self._pieces(lines, line_number) if len(readings))

    def _blocks(self, file: TextIO) -> Iterator[tuple[int, list[str]]]:
        """Whole lines in blocks, each with the number of its first line."""
        rest, number = "", 2
        while True:
            try:
                text = file.read(BLOCK)
            except (EOFError, OSError, ValueError) as error:
                self.warnings.append(
                    f"{self.path.name}: cut short after line {number} ({error}); read up to there"
                )
                text = ""
            lines = (rest + text).split("\n")
            rest = lines.pop() if text else ""
            if lines and lines != [""]:
                yield number, lines
            number += len(lines)
            if not text:
                return

    def _pieces(self, lines: list[str], first_line: int) -> Iterator[NDArray[Any]]:
        """The readings of some lines; what keeps them from the fast path is narrowed down to a few by halving."""
        if not lines or lines == [""]:
            return
        try:
            yield self._fast(lines, first_line)
        except ValueError:
            if len(lines) <= FEW:
                yield self._careful(lines, first_line)
                return
            half = len(lines) // 2
            yield from self._pieces(lines[:half], first_line)
            yield from self._pieces(lines[half:], first_line + half)

    def _fast(self, lines: list[str], first_line: int) -> NDArray[Any]:
        """All rows at once, column by column. Raises: ValueError where any row needs the careful path."""
        where = self._columns
        cells = list(zip_longest(*[line.split(",") for line in lines], fillvalue=""))
        if not where.z or len(cells) > where.count or len(cells) <= max(where.t, where.sensor) or "" in lines:
            raise ValueError
        cells += [("",) * len(lines)] * (where.count - len(cells))
        names = cells[where.sensor]
        unknown = {
            name: self._numbers.get(name.strip(), UNKNOWN) for name in set(names) - self._numbers.keys()
        }
        numbers = self._numbers | unknown
        out = np.zeros(len(lines), self.layout.reading)
        out["sensor"] = [numbers[name] for name in names]
        out["t_ns"] = nanoseconds_column(cells[where.t])
        self._fast_values(out, cells)
        self._fast_optional(out, cells)
        if not unknown:
            return out
        keep = out["sensor"] != UNKNOWN
        if not keep.all():
            first = int(np.argmin(keep))
            self._refuse_unknown(names[first], first_line + first, int(np.sum(~keep)))
        known: NDArray[Any] = out[keep]
        return known

    def _fast_values(self, out: NDArray[Any], cells: list[tuple[str, ...]]) -> None:
        payload = out["z"].shape[1]
        before: NDArray[np.bool_] | None = None
        for k, column in enumerate(self._columns.z):
            texts = cells[column]
            if k < payload:
                joined = "".join(texts)
                if "_" in joined or not joined.isascii():
                    raise ValueError
            if "" not in texts:
                present = np.ones(len(out), np.bool_)
                if k < payload:
                    out["z"][:, k] = list(map(float, texts))
            else:
                present = np.array([bool(text) for text in texts])
                if k < payload:
                    out["z"][:, k] = [float(text) if text else 0.0 for text in texts]
            if before is not None and np.any(present & ~before):
                raise ValueError
            out["length"] += present
            before = present

    def _fast_optional(self, out: NDArray[Any], cells: list[tuple[str, ...]]) -> None:
        where = self._columns
        if where.arrival >= 0:
            texts = cells[where.arrival]
            out["arrival_ns"] = nanoseconds_column([text or "0" for text in texts])
            out["flags"] |= np.array([HAS_ARRIVAL if text else 0 for text in texts])
        if where.seq >= 0:
            texts = cells[where.seq]
            if "".join(texts).strip("0123456789"):
                raise ValueError
            values = [int(text or "0") for text in texts]
            if max(values) >= 2**64:
                raise ValueError
            out["seq"] = np.array(values, dtype=np.uint64)
            out["flags"] |= np.array([HAS_SEQ if text else 0 for text in texts])

    def _careful(self, lines: list[str], first_line: int) -> NDArray[Any]:
        """Row by row: what can be read is kept, the rest is counted with the number of its line."""
        out = np.zeros(len(lines), self.layout.reading)
        kept = 0
        for number, line in enumerate(lines, first_line):
            if not line.strip():
                continue
            try:
                kept += self._row(out[kept], line, number)
            except ValueError as error:
                out[kept] = 0
                self.refusals.add(
                    Verdict.MALFORMED, f"{self.path.name} line {number}: {error or repr(line[:80])}"
                )
        return out[:kept]

    def _row(self, out: Any, line: str, number: int) -> int:
        where = self._columns
        cells = [cell.strip() for cell in line.split(",")]
        if len(cells) > where.count:
            raise ValueError(f"{len(cells)} cells under a header of {where.count}")
        cells += [""] * (where.count - len(cells))
        sensor = self._numbers.get(cells[where.sensor])
        if sensor is None:
            self._refuse_unknown(cells[where.sensor], number, 1)
            return 0
        out["sensor"] = sensor
        out["t_ns"] = nanoseconds_of(cells[where.t])
        values = [cells[column] for column in where.z]
        while values and not values[-1]:
            values.pop()
        out["length"] = len(values)
        for k, text in enumerate(values):
            if not text:
                raise ValueError(f"z{k} is missing in the middle of the row")
            if k < len(out["z"]):
                out["z"][k] = value_of(text)
        flags = 0
        if where.arrival >= 0 and cells[where.arrival]:
            out["arrival_ns"] = nanoseconds_of(cells[where.arrival])
            flags |= HAS_ARRIVAL
        if where.seq >= 0 and cells[where.seq]:
            out["seq"] = seq_of(cells[where.seq])
            flags |= HAS_SEQ
        out["flags"] = flags
        return 1

    def _refuse_unknown(self, name: str, line: int, count: int) -> None:
        self.refusals.add(
            Verdict.UNKNOWN_SENSOR, f"{self.path.name} line {line}: sensor {name.strip()!r}", count
        )


def value_of(text: str) -> float:
    """One number of a reading; `nan` and `inf` are numbers, for the engine to refuse. Raises: ValueError."""
    if not NUMBER.fullmatch(text) and not SPECIAL.fullmatch(text):
        raise ValueError(f"{text!r} is not a number")
    return float(text)


def seq_of(text: str) -> int:
    """A sequence number, 64 bits without a sign. Raises: ValueError."""
    if not (text.isascii() and text.isdigit() and int(text) < 2**64):
        raise ValueError(f"{text!r} is not a sequence number")
    return int(text)
