"""A put as its readings, and back with other numbers: everything a fault does not touch keeps its bytes or digits.

Packed records get a new checksum. JSON keeps its keys, their order and the text of every number that is not altered
(a time of nine decimals never passes through a float); white space may change.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from struct import Struct
from typing import Any

from fusiond.recording.decimal_time import nanoseconds_of
from fusiond.service.reading_record import CRC, ENCODING, FRAME, HEADER, MAGIC, R_FOLLOWS, VERSION
from fusiond.service.wire import TEXT_ENCODINGS
from fusiond.types import Slot


@dataclass(frozen=True, slots=True)
class Piece:
    """One reading of a put, or a part of it that is none.

    Args:
        raw: its bytes as they may be sent again.      t_ns: None where it cannot be read.
        z: its numbers.      variances: the diagonal of the R it brings, None where it brings none.
        other: its bytes with other numbers.
    """

    raw: bytes
    t_ns: int | None = None
    z: tuple[float, ...] = ()
    variances: tuple[float, ...] | None = None
    other: Callable[[Sequence[float]], bytes] | None = None


@dataclass(frozen=True, slots=True)
class Put:
    """The pieces of a put, and how they are put together again."""

    pieces: list[Piece]
    join: Callable[[list[bytes]], bytes]


def open_put(encoding: str, payload: bytes, slots: tuple[Slot, ...]) -> Put | None:
    """Take a put apart; None where it is neither records nor JSON.

    Args:
        slots: channels of the sensor, for readings that name their numbers; empty: the order in which they stand.
    """
    if encoding == ENCODING:
        return Put(_records(payload), b"".join)
    if encoding.startswith(TEXT_ENCODINGS):
        return _texts(payload, slots)
    return None


def _records(payload: bytes) -> list[Piece]:
    pieces: list[Piece] = []
    at = 0
    while at < len(payload):
        if len(payload) - at < FRAME:
            return [*pieces, Piece(payload[at:])]
        magic, version, flags, n, _, _ = HEADER.unpack_from(payload, at)
        end = at + FRAME + 8 * (n + n if flags & R_FOLLOWS else n)
        if magic != MAGIC or version != VERSION or flags & ~R_FOLLOWS or end > len(payload):
            # Behind a header that is none, nothing can be found any more.
            return [*pieces, Piece(payload[at:])]
        pieces.append(_record(payload[at:end]))
        at = end
    return pieces


def _record(raw: bytes) -> Piece:
    if zlib.crc32(raw[: -CRC.size]) != CRC.unpack_from(raw, len(raw) - CRC.size)[0]:
        return Piece(raw)
    _, _, flags, n, _, t_ns = HEADER.unpack_from(raw)
    numbers = Struct(f"<{n}d")
    after = HEADER.size + numbers.size

    def other(z: Sequence[float]) -> bytes:
        body = raw[: HEADER.size] + numbers.pack(*z) + raw[after : -CRC.size]
        return body + CRC.pack(zlib.crc32(body))

    variances = numbers.unpack_from(raw, after) if flags & R_FOLLOWS else None
    return Piece(raw, t_ns, numbers.unpack_from(raw, HEADER.size), variances, other)


class _Digits(str):
    """The text of a JSON number, told apart from a JSON string."""

    __slots__ = ()


_decoder = json.JSONDecoder(parse_float=_Digits, parse_int=_Digits, parse_constant=_Digits)


def _texts(payload: bytes, slots: tuple[Slot, ...]) -> Put:
    try:
        found: Any = _decoder.decode(payload.decode())
    except (ValueError, RecursionError):
        return Put([Piece(payload)], b"".join)
    if isinstance(found, list):
        return Put([_text(one, slots) for one in found], lambda parts: b"[" + b", ".join(parts) + b"]")
    return Put([_text(found, slots)], b"".join)


def _text(reading: Any, slots: tuple[Slot, ...]) -> Piece:
    raw = _dump(reading).encode()
    try:
        t_ns = int(reading["t_ns"]) if "t_ns" in reading else nanoseconds_of(reading["t"])
        if not -(2**63) <= t_ns < 2**63:
            return Piece(raw)
        named = "values" in reading
        texts = _named(reading["values"], slots) if named else dict(enumerate(reading["z"]))
        z = tuple(_number(text) for text in texts.values())
        variances = _variances(reading.get("R"))
    except (KeyError, TypeError, ValueError, AttributeError, IndexError):
        return Piece(raw)

    def other(values: Sequence[float]) -> bytes:
        # A number that stays the same keeps its digits.
        new = {
            key: text if same(before, value) else _Digits(json.dumps(float(value)))
            for (key, text), before, value in zip(texts.items(), z, values, strict=True)
        }
        numbers = {**reading["values"], **new} if named else list(new.values())
        return _dump({**reading, "values" if named else "z": numbers}).encode()

    return Piece(raw, t_ns, z, variances, other)


def same(a: float, b: float) -> bool:
    """Whether two numbers are the same, down to the sign of zero, or are both none."""
    return (a == b and math.copysign(1.0, a) == math.copysign(1.0, b)) or (math.isnan(a) and math.isnan(b))


def _number(text: Any) -> float:
    if not isinstance(text, _Digits):
        raise ValueError("not a number")
    return float(text)


def _named(values: dict[str, Any], slots: tuple[Slot, ...]) -> dict[Any, Any]:
    """Texts of named numbers in the order of the channels, as far as those are known."""
    if not slots:
        return values
    keys = [slot.name if slot.name in values else slot.key for slot in slots]
    return {key: values[key] for key in keys}


def _variances(R: Any) -> tuple[float, ...] | None:
    if R is None:
        return None
    diagonal = [row[k] if isinstance(row, list) else row for k, row in enumerate(R)]
    return tuple(_number(text) for text in diagonal)


def _dump(value: Any) -> str:
    if isinstance(value, _Digits):
        return str(value)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)}: {_dump(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_dump(one) for one in value) + "]"
    return json.dumps(value)
