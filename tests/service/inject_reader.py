"""Reads puts as any consumer might: JSON by the standard library, records by `struct`, checksum included."""

from __future__ import annotations

import json
import struct
import zlib
from decimal import Decimal
from typing import Any

import zenoh

HEADER = struct.Struct("<4sBBHQq")


def read(sample: zenoh.Sample) -> list[dict[str, Any]]:
    """The readings of a put: seq, t_ns, z, R."""
    payload = sample.payload.to_bytes()
    return _json(payload) if str(sample.encoding) == "application/json" else _records(payload)


def _json(payload: bytes) -> list[dict[str, Any]]:
    found = json.loads(payload, parse_float=Decimal)
    return [
        {
            "seq": one["seq"],
            "t_ns": int(one["t"] * 10**9),
            "z": [float(value) for value in one["z"]],
            "R": [float(value) for value in one["R"]],
        }
        for one in (found if isinstance(found, list) else [found])
    ]


def _records(payload: bytes) -> list[dict[str, Any]]:
    found, at = [], 0
    while at < len(payload):
        magic, version, flags, n, seq, t_ns = HEADER.unpack_from(payload, at)
        assert (magic, version, flags) == (b"FUS1", 1, 1)
        end = at + HEADER.size + 16 * n
        numbers = struct.unpack_from(f"<{2 * n}d", payload, at + HEADER.size)
        assert struct.unpack_from("<I", payload, end)[0] == zlib.crc32(payload[at:end])
        found.append({"seq": seq, "t_ns": t_ns, "z": list(numbers[:n]), "R": list(numbers[n:])})
        at = end + 4
    return found
