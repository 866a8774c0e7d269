"""Truth: a CSV of `t_s,` and names of states or derived outputs, interpolated linearly, angles on the circle."""

from __future__ import annotations

import csv
import gzip
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from fusiond.errors import LogError
from fusiond.recording.decimal_time import nanoseconds_column, nanoseconds_of
from fusiond.types import NANOSECONDS


def wrapped(angle_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same angles within [-pi, pi)."""
    return np.asarray((angle_rad + np.pi) % (2.0 * np.pi) - np.pi, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Truth:
    """What was really so.

    Args:
        t_ns: (N,) never decreasing.
        names: one for each column.
        values: (N, m); angles unwrapped, so that a straight line between two of them is the short way round.
        angles: (m,) True for columns in rad, which are compared on the circle.
    """

    t_ns: NDArray[np.int64]
    names: tuple[str, ...]
    values: NDArray[np.float64]
    angles: NDArray[np.bool_]

    def at(self, t_ns: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Truth at the given times.

        Returns: (K, m) values, angles in [-pi, pi), and (K,) whether truth covers that time (the values are
        its first or last outside).
        """
        last = len(self.t_ns) - 1
        start = max(0, int(np.searchsorted(self.t_ns, t_ns.min(), "right")) - 1) if len(t_ns) else 0
        stop = min(last, int(np.searchsorted(self.t_ns, t_ns.max(), "left"))) + 1 if len(t_ns) else 1
        start = min(start, stop - 1)
        origin = self.t_ns[start]
        at_s = (t_ns - origin) / NANOSECONDS
        known_s = (self.t_ns[start:stop] - origin) / NANOSECONDS
        out = np.empty((len(t_ns), len(self.names)))
        for column in range(len(self.names)):
            out[:, column] = np.interp(at_s, known_s, self.values[start:stop, column])
        out[:, self.angles] = wrapped(out[:, self.angles])
        return out, (t_ns >= self.t_ns[0]) & (t_ns <= self.t_ns[-1])

    def errors(self, estimates: NDArray[np.float64], truth: NDArray[np.float64]) -> NDArray[np.float64]:
        """estimate - truth, both (K, m) in the order of `names`; angles within [-pi, pi)."""
        difference = estimates - truth
        difference[:, self.angles] = wrapped(difference[:, self.angles])
        return difference


def read_truth(path: Path, angles: Collection[str]) -> Truth:
    """Read a truth CSV (also gzipped).

    Args:
        angles: names of the columns in rad, those the caller does not have included or not.
    Raises: LogError where the file is missing, not a truth file, or not in the order of time.
    """
    try:
        with open_text(path) as file:
            reader = csv.reader(file)
            rows = [(reader.line_num, row) for row in reader if row]
    except OSError as error:
        raise LogError(f"{path}: cannot be read ({error.strerror or error}); name a truth CSV") from error
    except (EOFError, UnicodeDecodeError, csv.Error) as error:
        raise LogError(f"{path}: cannot be read as text ({error}); name a truth CSV") from error
    header = [name.strip() for name in rows[0][1]] if rows else []
    if len(header) < 2 or header[0] != "t_s" or len(set(header)) != len(header):
        raise LogError(
            f"{path.name}: no truth file; write a header `t_s,` and names of states or outputs, each once"
        )
    if len(rows) < 2:
        raise LogError(f"{path.name}: has no rows; write at least one time with its values")
    t_ns, values = _columns(path, len(header), rows[1:])
    if np.any(np.diff(t_ns) < 0):
        line = rows[int(np.argmax(np.diff(t_ns) < 0)) + 2][0]
        raise LogError(f"{path.name}: line {line} is earlier than the one before; sort the file by time")
    names = tuple(header[1:])
    circular = np.array([name in angles for name in names], dtype=np.bool_)
    values[:, circular] = np.unwrap(values[:, circular], axis=0)
    return Truth(t_ns, names, values, circular)


def _columns(
    path: Path, width: int, rows: Sequence[tuple[int, list[str]]]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Times, (N,) ns, and values, (N, width - 1), of rows with their lines; raises LogError that names a bad line."""
    try:
        t_ns = nanoseconds_column([row[0].strip() for _, row in rows])
        values = np.array([row[1:] for _, row in rows], dtype=np.float64)
        if values.shape[1] == width - 1 and np.all(np.isfinite(values)):
            return t_ns, values
    except ValueError:
        pass
    line = next(line for line, row in rows if not _is_row(row, width))
    raise LogError(f"{path.name}: line {line} is not {width} finite numbers; correct or remove it")


def _is_row(row: list[str], width: int) -> bool:
    try:
        nanoseconds_of(row[0])
        return len(row) == width and all(math.isfinite(float(cell)) for cell in row[1:])
    except ValueError:
        return False


def open_text(path: Path) -> TextIO:
    """A text file, unpacked where its name says gzip."""
    if path.suffix == ".gz":
        return gzip.open(path, "rt", encoding="utf-8-sig", newline="")
    return path.open("rt", encoding="utf-8-sig", newline="")
