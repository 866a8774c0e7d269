"""Reports as plain tuples: reading fields of numpy records one by one costs more than the whole step."""

from __future__ import annotations

from collections.abc import Iterator
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout

CODES = {"<i8": "q", "<u8": "Q", "<i4": "i", "<f8": "d"}
HEAD = ("t_ns", "sensor", "verdict", "action", "service", "state_t_ns", "command_due")
STATE = ("x", "std", "resets", "jump", "unobserved")
COMMAND = ("command_valid", "command")


class ReportRows:
    """Reads reports of one layout.

    Args:
        layout: gives the dtype; its fields are taken from it, in its order (checked by the unpacking itself).
    """

    def __init__(self, layout: Layout) -> None:
        dtype = layout.report
        self.size = dtype.itemsize
        self._head = fields_struct(dtype, HEAD, whole=True)
        self._state = fields_struct(dtype, STATE)
        self._command = fields_struct(dtype, COMMAND)
        self._levels = fields_struct(dtype, ("protection",)) if layout.protected else None
        self._n, self._errors = layout.shape.states, layout.shape.errors
        self._controls = len(layout.controls)

    def open(self, reports: NDArray[Any]) -> bytes:
        """The bytes of a batch of reports, for the methods below; a copy costs less than a view."""
        return reports.tobytes()

    def heads(self, raw: bytes) -> Iterator[tuple[Any, ...]]:
        """`t_ns, sensor, verdict, action, service, state_t_ns, command_due` of every report, in order."""
        return self._head.iter_unpack(raw)

    def state(
        self, raw: bytes, k: int
    ) -> tuple[tuple[float, ...], tuple[float, ...], int, tuple[float, ...], int]:
        """State, standard deviations, number of resets, last jump and unobserved states of report k."""
        numbers = self._state.unpack_from(raw, k * self.size)
        end = self._n + self._errors
        return numbers[: self._n], numbers[self._n : end], numbers[end], numbers[end + 1 : -1], numbers[-1]

    def protection(self, raw: bytes, k: int) -> tuple[float, ...]:
        """Protection levels of report k; empty where none were asked for."""
        return self._levels.unpack_from(raw, k * self.size) if self._levels else ()

    def command(self, raw: bytes, k: int) -> tuple[bool, tuple[float, ...]]:
        """Whether the command of report k is valid, and the command."""
        valid, *numbers = self._command.unpack_from(raw, k * self.size)
        return bool(valid), tuple(numbers[: self._controls])


def fields_struct(dtype: np.dtype[Any], names: tuple[str, ...], *, whole: bool = False) -> Struct:
    """Unpacks some fields of a packed record, subarrays number by number, in the record's order.

    Args:
        names: in the order they have in the record.   whole: as long as the record, for `iter_unpack`.
    """
    fields: Any = dtype.fields
    text, at = "<", 0
    for name in names:
        kind, offset = fields[name][:2]
        count = int(np.prod(kind.shape)) if kind.shape else 1
        text += f"{offset - at}x{count}{CODES[kind.base.str]}"
        at = offset + kind.itemsize
    return Struct(text + (f"{dtype.itemsize - at}x" if whole else ""))
