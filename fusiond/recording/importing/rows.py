"""Rows of foreign recordings, whatever they come from: a number, a time or a text by the name of its field."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fusiond.recording.decimal_time import DIGITS, POWERS, nanoseconds_of
from fusiond.recording.importing.mapping import Field
from fusiond.types import NANOSECONDS


class MissingField(LookupError):
    """Raised when a row has no field of that name; its text lists those it has."""


class Row(Protocol):
    """One row or message."""

    def number(self, field: Field) -> float:
        """A number. Raises: MissingField; ValueError where it is none."""

    def time_ns(self, field: Field, unit: str) -> int:
        """A time, exact where the recording has it as text or integers. Raises: as `number`."""

    def text(self, field: Field) -> str:
        """The field as text. Raises: MissingField."""


class TextRow:
    """One line of a text file."""

    __slots__ = ("_cells", "_columns")

    def __init__(self, cells: Sequence[str], columns: dict[str, int]) -> None:
        self._cells = cells
        self._columns = columns

    def text(self, field: Field) -> str:
        """The cell, without blanks around it."""
        at = field if isinstance(field, int) else self._columns.get(field)
        if at is None:
            raise MissingField(
                f"has no column {field!r}, only {', '.join(self._columns) or 'columns without names'}"
            )
        if not 0 <= at < len(self._cells):
            raise ValueError(f"has {len(self._cells)} cells, none at {field!r}")
        return self._cells[at].strip()

    def number(self, field: Field) -> float:
        """The cell as a number."""
        return float(self.text(field))

    def time_ns(self, field: Field, unit: str) -> int:
        """The cell as a time, exact."""
        return nanoseconds_of(self.text(field), unit)


class ArrayRow:
    """One row of a numpy matrix, or one time and one row of a pair of files (field `t`)."""

    __slots__ = ("_t", "_values")

    def __init__(self, values: NDArray[Any], t: Any = None) -> None:
        self._values = values
        self._t = t

    def number(self, field: Field) -> float:
        """An element."""
        if field == "t" and self._t is not None:
            return float(self._t)
        if not isinstance(field, int) or not 0 <= field < len(self._values):
            raise MissingField(f"has no column {field!r}; count from 0 to {len(self._values) - 1}")
        return float(self._values[field])

    def time_ns(self, field: Field, unit: str) -> int:
        """An element as a time: the shortest decimal that is this float, exact."""
        return nanoseconds_of(repr(self.number(field)), unit)

    def text(self, field: Field) -> str:
        """An element, whole numbers without a point."""
        value = self.number(field)
        return str(int(value)) if value.is_integer() else repr(value)


class MessageRow:
    """One message of a bag or an MCAP file: attributes, mappings and elements by dotted fields."""

    __slots__ = ("_log_time_ns", "_message")

    def __init__(self, message: Any, log_time_ns: int) -> None:
        self._message = message
        self._log_time_ns = log_time_ns

    def value(self, field: Field) -> Any:
        """Whatever stands at a dotted field."""
        at = self._message
        for part in str(field).split("."):
            at = member(at, part, str(field))
        return at

    def number(self, field: Field) -> float:
        """A field as a number."""
        value = self.value(field)
        if isinstance(value, bool | int | float | np.number | str):
            return float(value)
        raise MissingField(
            f"field {field!r} is a {type(value).__name__}, not a number; name one of its members"
        )

    def time_ns(self, field: Field, unit: str) -> int:
        """`log_time`, a ROS stamp (exact), or a number in `unit`."""
        if field == "log_time":
            return self._log_time_ns
        value = self.value(field)
        for whole, rest in (("sec", "nanosec"), ("sec", "nsec"), ("secs", "nsecs")):
            try:
                return int(member(value, whole, "")) * NANOSECONDS + int(member(value, rest, ""))
            except MissingField:
                continue
        if isinstance(value, int | np.integer) and unit in DIGITS:
            scale: int = POWERS[9 - DIGITS[unit]]
            return int(value) * scale
        return nanoseconds_of(value if isinstance(value, str) else repr(float(value)), unit)

    def text(self, field: Field) -> str:
        """A field as text."""
        return str(self.value(field))


def member(value: Any, part: str, field: str) -> Any:
    """One step into a message."""
    if isinstance(value, dict):
        if part in value:
            return value[part]
        known = ", ".join(value)
    elif part.isdigit() and isinstance(value, list | tuple | np.ndarray):
        if int(part) < len(value):
            return value[int(part)]
        known = f"elements up to {len(value) - 1}"
    else:
        if not part.startswith("_") and hasattr(value, part):
            return getattr(value, part)
        known = ", ".join(
            name for name in getattr(value, "__dataclass_fields__", ()) if not name.startswith("_")
        )
    raise MissingField(f"has no {part!r} of field {field!r}, only {known or type(value).__name__}")
