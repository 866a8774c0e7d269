"""Estimate and control as packed records, for consumers that count microseconds (`service.format = "record"`).

`<4sBBHQQqQ` magic `FUSE` (estimate) or `FUSC` (control), version (2, 1), health of the service (0 nominal, 1 degraded,
2 dead reckoning, 3 invalid; of a command its level, 3 safe), count n, u64 seq, u64 epoch, i64 t_ns, u64 resets
(estimate) or valid (control); then f64 state[n], std[m], jump[m] (estimate; the last reset's, zeros before the first)
or u[n], age_s (control); u32 CRC-32 of all before. Names and order of the numbers are those of the configuration (ask
`config`). An estimate that is not finite has no state and std, n = 0, and health 3.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from struct import Struct
from typing import Any

from fusiond.control.levels import Level
from fusiond.service.messages import LEVEL_LABELS, SERVICE_LABELS
from fusiond.types import ServiceHealth

ESTIMATE_ENCODING = "application/octet-stream;fusiond.estimate.v2"
CONTROL_ENCODING = "application/octet-stream;fusiond.control.v1"
OUTPUT_ENCODINGS = (ESTIMATE_ENCODING, CONTROL_ENCODING)
HEADER = Struct("<4sBBHQQqQ")
CRC = Struct("<I")
VERSIONS = {b"FUSE": 2, b"FUSC": 1}
INVALID, SAFE = int(ServiceHealth.INVALID), int(Level.SAFE)


def encode_estimate(
    t_ns: int, seq: int, epoch: int, resets: int, jump: Sequence[float], x: Sequence[float], std: Sequence[float],
    service: int,
) -> bytes:  # fmt: skip
    """One estimate; one that is not finite becomes an empty, invalid one."""
    if not all(map(math.isfinite, (*x, *std))):
        x, std, service = (), (), INVALID
    body = HEADER.pack(b"FUSE", VERSIONS[b"FUSE"], service, len(x), seq, epoch, t_ns, resets)
    return _sealed(body + Struct(f"<{len(x) + len(std) + len(jump)}d").pack(*x, *std, *jump))


def encode_control(
    t_ns: int, seq: int, epoch: int, u: Sequence[float], valid: bool, age_s: float, level: int
) -> bytes:
    """One command; one that is not finite goes out as zeros, not valid, at the level safe."""
    if not all(map(math.isfinite, u)):
        u, valid, level = [0.0] * len(u), False, SAFE
    body = HEADER.pack(b"FUSC", VERSIONS[b"FUSC"], level, len(u), seq, epoch, t_ns, int(valid))
    return _sealed(body + Struct(f"<{len(u) + 1}d").pack(*u, age_s))


def decode_output(payload: bytes) -> dict[str, Any]:
    """An estimate or a command as the JSON message it stands for, its numbers as lists.

    Raises: ValueError where the bytes are neither, or were changed on the way.
    """
    whole = len(payload) >= HEADER.size + CRC.size
    if not whole or CRC.unpack_from(payload, len(payload) - 4)[0] != zlib.crc32(payload[:-4]):
        raise ValueError("not a sound record")
    magic, version, service, n, seq, epoch, t_ns, extra = HEADER.unpack_from(payload)
    size, rest = divmod(len(payload) - HEADER.size - CRC.size, 8)
    fits = {b"FUSE": size >= n, b"FUSC": size == n + 1}.get(magic, False)
    if not fits or rest or version != VERSIONS[magic]:
        raise ValueError("neither an estimate of version 2 nor a command of version 1")
    numbers = list(Struct(f"<{size}d").unpack_from(payload, HEADER.size))
    message: dict[str, Any] = {"t": t_ns / 1e9, "t_ns": t_ns, "seq": seq, "epoch": epoch}
    if magic == b"FUSE":
        end = n + (size - n) // 2 if n else 0
        return message | {
            "resets": extra, "jump": numbers[end:], "state": numbers[:n], "std": numbers[n:end],
            "health": SERVICE_LABELS[service],
        }  # fmt: skip
    return message | {
        "u": numbers[:n],
        "valid": bool(extra),
        "age_s": numbers[n],
        "level": LEVEL_LABELS[service],
    }


def _sealed(body: bytes) -> bytes:
    return body + CRC.pack(zlib.crc32(body))
