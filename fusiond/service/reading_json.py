"""The reading for people: `{"t": s or "t_ns": int, "z": [...], "seq": n, "R": [variances] or [[rows]]}`.

`values` (numbers by the channel's name, with or without unit) may stand for `z`; an array packs several readings in
a put. Times in decimal seconds become nanoseconds exactly: they never pass through a float.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from struct import Struct
from typing import Any

import numpy as np

from fusiond.engine.layout import SensorLayout
from fusiond.recording.decimal_time import nanoseconds_of, seconds_text
from fusiond.service.reading_batch import ReadingBatch
from fusiond.types import NANOSECONDS

ENCODING = "application/json"
KEYS = frozenset({"t", "t_ns", "z", "values", "seq", "R"})
MOST_NUMBERS = 4096


class Unread(ValueError):
    """Raised inside this file where a reading is not what it should be; becomes a verdict at its edge."""


class _Decimal(str):
    """The digits of a JSON number with a fraction or an exponent, told apart from a JSON string."""

    __slots__ = ()


_decoder = json.JSONDecoder(parse_float=_Decimal)


def encode_json(
    z: Sequence[float],
    t_ns: int,
    seq: int | None = None,
    R: Sequence[float] | Sequence[Sequence[float]] | None = None,
) -> str:
    """One reading as JSON, its time in decimal seconds with all nine digits."""
    parts = [f'"t": {seconds_text(t_ns)}', f'"z": {json.dumps([float(v) for v in z])}']
    if seq is not None:
        parts.append(f'"seq": {int(seq)}')
    if R is not None:
        parts.append(f'"R": {json.dumps(np.asarray(R, dtype=np.float64).tolist())}')
    return "{" + ", ".join(parts) + "}"


def decode_json(payload: bytes, sensor: SensorLayout, arrival_ns: int, batch: ReadingBatch) -> list[str]:
    """Append the readings of a put to the batch; never raises.

    Returns: why, for every reading that is malformed (once for a text that is no JSON).
    """
    try:
        found: Any = _decoder.decode(payload.decode())
    except (ValueError, RecursionError, MemoryError) as error:
        return [f"no JSON, {error}"]
    refused = []
    for reading in found if isinstance(found, list) else [found]:
        before = batch.count
        try:
            _append(reading, sensor, arrival_ns, batch)
        except (ValueError, OverflowError, RecursionError) as error:
            batch.count = before
            refused.append(str(error))
    return refused or ([] if found != [] else ["no reading in []"])


def _append(reading: Any, sensor: SensorLayout, arrival_ns: int, batch: ReadingBatch) -> None:
    if not isinstance(reading, dict) or not KEYS.issuperset(reading):
        raise Unread(f"not an object of {', '.join(sorted(KEYS))} alone")
    z = _values(reading["values"], sensor) if "values" in reading else _numbers("z", reading.get("z"))
    t_ns = _time_ns(reading)
    seq = reading.get("seq")
    if seq is not None and (type(seq) is not int or not 0 <= seq < 2**64):
        raise Unread("seq: no unsigned 64-bit integer")
    batch.add(sensor.number, arrival_ns, t_ns, seq, Struct(f"<{len(z)}d").pack(*z))
    R = reading.get("R")
    if R is None:
        return
    if not isinstance(R, list) or len(R) != len(z):
        raise Unread("R: does not fit z")
    if R and isinstance(R[0], list):
        rows = [_numbers("R", row) for row in R]
        if any(len(row) != len(z) for row in rows):
            raise Unread("R: is not square")
        batch.add_covariance(rows)
    else:
        batch.add_variances(_numbers("R", R))


def _number(what: str, value: Any) -> float:
    """A JSON number; the literals NaN and Infinity too, since refusing those by name is the engine's verdict."""
    if type(value) in (int, float, _Decimal):
        return float(value)
    raise Unread(f"{what}: not a number")


def _numbers(what: str, values: Any) -> list[float]:
    if not isinstance(values, list) or len(values) > MOST_NUMBERS:
        raise Unread(f"{what}: not a list of numbers")
    return [_number(what, value) for value in values]


def _values(values: Any, sensor: SensorLayout) -> list[float]:
    """Numbers in the order of the sensor's channels, from a mapping by channel name or key."""
    if not isinstance(values, dict) or len(values) != len(sensor.channels):
        raise Unread(f"values: not {', '.join(slot.name for slot in sensor.channels)}, each once")
    return [
        _number(f"values.{slot.name}", values.get(slot.name, values.get(slot.key)))
        for slot in sensor.channels
    ]


def _time_ns(reading: dict[str, Any]) -> int:
    if "t_ns" in reading:
        t_ns = reading["t_ns"]
        if type(t_ns) is not int or "t" in reading:
            raise Unread("t_ns: no integer, or beside t")
    else:
        t = reading.get("t")
        if type(t) is _Decimal:
            t_ns = nanoseconds_of(t)
        elif type(t) is int:
            t_ns = t * NANOSECONDS
        else:
            raise Unread("t: no number of seconds")
    if not -(2**63) <= t_ns < 2**63:
        raise Unread("t: does not fit 64-bit nanoseconds")
    return t_ns
