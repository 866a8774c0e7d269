"""Where two runs differ first, and by how much."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.errors import LogError
from fusiond.recording.description import Description, description_of
from fusiond.recording.mcap_blocks import McapFile
from fusiond.types import EVENTS, seconds


@dataclass(frozen=True, slots=True)
class First:
    """The first difference: report number (from 0), where in it, and both values."""

    report: int
    sensor: str
    t_s: float
    field: str
    a: float
    b: float

    def text(self) -> str:
        """For people."""
        return (
            f"report {self.report} ({self.sensor}, t = {self.t_s:.9f} s): {self.field} {self.a!r} against {self.b!r} "
            f"(difference {abs(self.a - self.b):.6g})"
        )


@dataclass(frozen=True, slots=True)
class Difference:
    """Two runs compared, arrival times left out.

    Args:
        equal: every report has the same bits and there are as many.
        reports: how many each run has.
        differing: reports that differ among those both have.
        first: the first difference, None where all reports both have are equal.
        largest: largest absolute difference by field, infinite where one is not a number; bits of zero differ
            by 0.
        notes: what else is different or wrong.
    """

    equal: bool
    reports: tuple[int, int]
    differing: int
    first: First | None
    largest: dict[str, float]
    notes: tuple[str, ...]

    def json_object(self) -> dict[str, Any]:
        """For `diff --json`."""
        first = self.first
        return {
            "equal": self.equal,
            "reports": list(self.reports),
            "differing": self.differing,
            "first": None if first is None else {name: getattr(first, name) for name in First.__slots__},
            "largest": self.largest,
            "notes": list(self.notes),
        }


class Reports:
    """The reports of one run, in pieces of any length."""

    def __init__(self, path: Path) -> None:
        self.file = McapFile(path)
        head = self.file.head()
        if not head:
            raise LogError(
                f"{path.name}: was not recorded by fusiond; compare runs of `run --record` or `replay --out`"
            )
        try:
            self.description: Description = description_of(head["layout"])
        except (KeyError, TypeError, ValueError) as error:
            raise LogError(
                f"{path.name}: its metadata is not what fusiond writes ({error}); record it again"
            ) from error
        self.count = 0
        self._blocks = self.file.blocks("reports")
        self._block: NDArray[Any] | None = None

    def available(self) -> int:
        """How many reports can be taken at once; 0 at the end."""
        while self._block is None or not len(self._block):
            try:
                self._block = next(self._blocks)
            except StopIteration:
                return 0
        return len(self._block)

    @property
    def dtype(self) -> np.dtype[Any] | None:
        """dtype of the reports, None where there is none."""
        return None if not self.available() or self._block is None else self._block.dtype

    def take(self, number: int) -> NDArray[Any]:
        """The next reports, arrival times set to 0; at most `available()`."""
        assert self._block is not None
        taken = self._block[:number].copy()
        self._block = self._block[number:]
        taken["arrival_ns"] = 0
        self.count += len(taken)
        return taken

    def drain(self) -> None:
        """Count the rest."""
        while number := self.available():
            self.take(number)


def diff(path_a: Path, path_b: Path) -> Difference:
    """Compare the reports of two runs. Raises: LogError where one is no recording of fusiond or has no
    reports.
    """
    a, b = Reports(path_a), Reports(path_b)
    for run, path in ((a, path_a), (b, path_b)):
        if not run.available():
            raise LogError(f"{path.name}: holds no reports; compare runs of `run --record` or `replay --out`")
    notes = list(layout_notes(a.description, b.description))
    comparison = Comparison(a.description)
    if a.dtype == b.dtype:
        while number := min(a.available(), b.available()):
            comparison.add(a.take(number), b.take(number))
    else:
        notes.append("the reports have different sizes, so nothing in them can be compared")
    a.drain()
    b.drain()
    if a.count != b.count:
        notes.append(
            f"{abs(a.count - b.count)} reports stand only in {(path_a if a.count > b.count else path_b).name}"
        )
    notes += [*a.file.warnings, *b.file.warnings]
    return Difference(
        equal=not notes and comparison.first is None,
        reports=(a.count, b.count),
        differing=comparison.differing,
        first=comparison.first,
        largest=comparison.largest,
        notes=tuple(notes),
    )


def layout_notes(a: Description, b: Description) -> Iterator[str]:
    """What the two runs call differently."""
    for what in ("states", "controls", "sensors"):
        names_a, names_b = ([item.name for item in getattr(d, what)] for d in (a, b))
        if names_a != names_b:
            yield f"different {what}: {', '.join(names_a) or 'none'} against {', '.join(names_b) or 'none'}"


@dataclass(slots=True)
class Comparison:
    """Differences summed up while blocks of equal length come in."""

    description: Description
    first: First | None = None
    differing: int = 0
    seen: int = 0
    largest: dict[str, float] = field(default_factory=dict)

    def add(self, a: NDArray[Any], b: NDArray[Any]) -> None:
        """Compare two blocks of the same length and dtype."""
        size = a.dtype.itemsize
        bytes_a, bytes_b = (np.frombuffer(block.tobytes(), np.uint8).reshape(-1, size) for block in (a, b))
        rows = np.flatnonzero(np.any(bytes_a != bytes_b, axis=1))
        if len(rows):
            self.differing += len(rows)
            self._fields(a[rows], b[rows], self.seen + rows)
        self.seen += len(a)

    def _fields(self, a: NDArray[Any], b: NDArray[Any], numbers: NDArray[np.int64]) -> None:
        candidates: list[tuple[int, int, str, Any, Any]] = []
        for order, name in enumerate(a.dtype.names or ()):
            values_a, values_b = (block[name].reshape(len(block), -1) for block in (a, b))
            unlike = bits_differ(values_a, values_b)
            for column in np.flatnonzero(unlike.any(axis=0)):
                label = self._label(name, int(column), a.dtype[name].shape)
                amount = float(np.max(distance(values_a[:, column], values_b[:, column])))
                self.largest[label] = max(self.largest.get(label, 0.0), amount)
                row = int(np.argmax(unlike[:, column]))
                candidates.append((row, order, label, values_a[row, column], values_b[row, column]))
        if self.first is None and candidates:
            row, _, label, value_a, value_b = min(candidates, key=lambda c: c[:2])
            sensor = self._sensor(int(a["sensor"][row]))
            t_s = seconds(int(a["t_ns"][row]))
            self.first = First(int(numbers[row]), sensor, t_s, label, value_a.item(), value_b.item())

    def _sensor(self, number: int) -> str:
        if number in EVENTS:
            return EVENTS[number]
        sensors = self.description.sensors
        return sensors[number].name if 0 <= number < len(sensors) else f"sensor {number}"

    def _label(self, name: str, column: int, shape: tuple[int, ...]) -> str:
        slots = {"x": "states", "std": "errors", "health": "sensors", "command": "controls"}.get(name, "")
        named = [item.name for item in getattr(self.description, slots)] if slots else []
        if column < len(named):
            return f"{name}.{named[column]}"
        return f"{name}[{column}]" if shape else name


def bits_differ(a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.bool_]:
    """Element by element, whether the bits differ: NaN equals itself, 0.0 does not equal -0.0."""
    size = a.dtype.itemsize
    kind = f"<u{size}"
    return np.asarray(np.ascontiguousarray(a).view(kind) != np.ascontiguousarray(b).view(kind))


def distance(a: NDArray[Any], b: NDArray[Any]) -> NDArray[np.float64]:
    """|a - b|, 0 where both are the same infinity or both not a number, infinite where only one is a number."""
    x, y = a.astype(np.float64), b.astype(np.float64)
    same = (x == y) | (np.isnan(x) & np.isnan(y))
    with np.errstate(invalid="ignore"):
        difference = np.abs(x - y)
    return np.asarray(np.where(same, 0.0, np.where(np.isnan(difference), np.inf, difference)))
