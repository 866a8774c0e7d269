"""A reading as JSON and back, bit for bit: what a viewer plots and a person reads.

Numbers that JSON has not (`NaN`, `Infinity`, `-Infinity`) are written as strings of that name.
"""

from __future__ import annotations

import json
import math
from typing import Any

from fusiond.engine.records import HAS_ARRIVAL, HAS_R, HAS_SEQ
from fusiond.recording.decimal_time import nanoseconds_of
from fusiond.types import EVENTS, seconds


class Digits(str):
    """The digits of a JSON number with a fraction or an exponent: a time must not pass through a float."""

    __slots__ = ()


def number_json(value: float) -> float | str:
    """A number, or the name of one that JSON has not."""
    value = float(value)
    if math.isfinite(value):
        return value
    return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"


def reading_json(reading: Any) -> bytes:
    """One reading or event as a JSON message; `length` stands in it only where it differs from what z holds."""
    flags, length = int(reading["flags"]), int(reading["length"])
    t_ns = int(reading["t_ns"])
    message: dict[str, Any] = {"t": seconds(t_ns), "t_ns": t_ns}
    if flags & HAS_ARRIVAL:
        message["arrival_ns"] = int(reading["arrival_ns"])
    if int(reading["sensor"]) in EVENTS:
        return json.dumps(message).encode()
    z = reading["z"][:length]
    message["z"] = [number_json(value) for value in z]
    if length != len(z):
        message["length"] = length
    if flags & HAS_SEQ:
        message["seq"] = int(reading["seq"])
    if flags & HAS_R:
        message["R"] = [[number_json(value) for value in row] for row in reading["R"][:length, :length]]
    return json.dumps(message).encode()


def fill_reading(out: Any, data: bytes, log_time_ns: int, arrival_is_log_time: bool) -> None:
    """Fill one zeroed reading from a JSON message; its sensor is the caller's.

    Raises: ValueError, TypeError or KeyError where the message is no reading.
    """
    message = json.loads(data, parse_float=Digits)
    out["t_ns"] = int(message["t_ns"]) if "t_ns" in message else nanoseconds_of(str(message["t"]))
    flags = 0
    arrival = message.get("arrival_ns", log_time_ns if arrival_is_log_time else None)
    if arrival is not None:
        out["arrival_ns"] = arrival
        flags |= HAS_ARRIVAL
    z = [float(value) for value in message.get("z", ())]
    held = min(len(z), len(out["z"]))
    out["z"][:held] = z[:held]
    out["length"] = message.get("length", len(z))
    if message.get("seq") is not None:
        out["seq"] = message["seq"]
        flags |= HAS_SEQ
    if message.get("R") is not None:
        fill_covariance(out["R"], message["R"])
        flags |= HAS_R
    out["flags"] = flags


def fill_covariance(out: Any, rows: list[Any]) -> None:
    """A covariance given as variances or as rows; what does not fit is left out, as with z."""
    held = min(len(rows), len(out))
    for i, row in enumerate(rows[:held]):
        if isinstance(row, list):
            values = [float(value) for value in row[:held]]
            out[i, : len(values)] = values
        else:
            out[i, i] = float(row)
