"""The packed reading: `<4sBBHQq` magic, version, flags, n, seq, t_ns; f64 z[n]; f64 R[n] if flags bit 0; u32 CRC-32.

Several records may stand one behind the other in a put. The CRC (zlib) covers all bytes of its record before it.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from struct import Struct
from typing import Any

import numpy as np

from fusiond.engine.records import HAS_ARRIVAL, HAS_R, HAS_SEQ
from fusiond.service.reading_batch import ReadingBatch
from fusiond.types import Verdict

ENCODING = "application/octet-stream;fusiond.reading.v1"
MAGIC = b"FUS1"
VERSION = 1
R_FOLLOWS = 1
HEADER = Struct("<4sBBHQq")
CRC = Struct("<I")
FRAME = HEADER.size + CRC.size

WORTH_JOINING = 8
"""Puts of one record from which decoding them by columns is faster than one by one."""

Refused = list[Verdict]


def encode_record(z: Sequence[float], t_ns: int, seq: int, R: Sequence[float] | None = None) -> bytes:
    """One record.

    Args:
        z: the numbers of the reading, SI units.      R: their variances, or nothing.
    Raises: ValueError where R is not as long as z; struct.error where a number does not fit its field.
    """
    if R is not None and len(R) != len(z):
        raise ValueError(f"R has {len(R)} variances for {len(z)} numbers; a record carries one for each")
    numbers = list(z) if R is None else [*z, *R]
    body = HEADER.pack(MAGIC, VERSION, 0 if R is None else R_FOLLOWS, len(z), seq, t_ns)
    body += Struct(f"<{len(numbers)}d").pack(*numbers)
    return body + CRC.pack(zlib.crc32(body))


def decode_records(payload: bytes, sensor: int, arrival_ns: int, batch: ReadingBatch) -> Refused:
    """Append every sound record of a put to the batch; never raises.

    Returns: one verdict for every record refused. Behind a header that is none, nothing can be found any more: the
        rest of the put counts as one.
    """
    size = len(payload)
    if size < FRAME:
        return [Verdict.MALFORMED]
    magic, version, flags, n, seq, t_ns = HEADER.unpack_from(payload)
    end = FRAME + 8 * (n + n if flags & R_FOLLOWS else n)
    if size == end:
        if magic != MAGIC or version != VERSION or flags & ~R_FOLLOWS:
            return [Verdict.MALFORMED]
        if zlib.crc32(payload[:-4]) != CRC.unpack_from(payload, end - 4)[0]:
            return [Verdict.BAD_CRC]
        batch.add(sensor, arrival_ns, t_ns, seq, payload[HEADER.size : HEADER.size + 8 * n])
        if flags:
            batch.add_variances(Struct(f"<{n}d").unpack_from(payload, HEADER.size + 8 * n))
        return []
    if size % end == 0 and _decode_equal(payload, n, flags, sensor, arrival_ns, batch):
        return []
    return _decode_each(payload, sensor, arrival_ns, batch)


def decode_puts(payloads: list[bytes], sensor: int, arrivals_ns: list[int], batch: ReadingBatch) -> Refused:
    """Append the records of several puts of one length; equals `decode_records` one by one, and is faster."""
    if len(payloads) >= WORTH_JOINING and len(payloads[0]) >= FRAME:
        _, _, flags, n, _, _ = HEADER.unpack_from(payloads[0])
        single = len(payloads[0]) == FRAME + 8 * (n + n if flags & R_FOLLOWS else n)
        if single and _decode_equal(b"".join(payloads), n, flags, sensor, arrivals_ns, batch):
            return []
    refused: Refused = []
    for payload, arrival_ns in zip(payloads, arrivals_ns, strict=True):
        refused += decode_records(payload, sensor, arrival_ns, batch)
    return refused


def _decode_each(payload: bytes, sensor: int, arrival_ns: int, batch: ReadingBatch) -> Refused:
    """One record after the other, whatever their sizes."""
    refused: Refused = []
    at = 0
    while at < len(payload):
        if len(payload) - at < FRAME:
            return [*refused, Verdict.MALFORMED]
        magic, version, flags, n, _, _ = HEADER.unpack_from(payload, at)
        end = at + FRAME + 8 * (n + n if flags & R_FOLLOWS else n)
        if magic != MAGIC or version != VERSION or flags & ~R_FOLLOWS or end > len(payload):
            return [*refused, Verdict.MALFORMED]
        refused += decode_records(payload[at:end], sensor, arrival_ns, batch)
        at = end
    return refused


def _decode_equal(
    payload: bytes, n: int, flags: int, sensor: int, arrival_ns: int | list[int], batch: ReadingBatch
) -> bool:
    """Records of one size and kind, by whole columns. False, and nothing appended, where any of them is unsound.

    Args:
        arrival_ns: of them all, or of each.
    """
    with_R = bool(flags & R_FOLLOWS)
    wire = np.frombuffer(payload, _wire_dtype(n, with_R))
    head = wire["head"]
    sound = int.from_bytes(HEADER.pack(MAGIC, VERSION, flags, n, 0, 0)[:8], "little")
    if flags & ~R_FOLLOWS or not (head == sound).all():
        return False
    size = wire.itemsize
    whole = memoryview(payload)
    crcs = [zlib.crc32(whole[at : at + size - 4]) for at in range(0, len(payload), size)]
    if not np.array_equal(wire["crc"], np.array(crcs, dtype=np.uint32)):
        return False
    out = batch.reserve(len(wire))
    kept = min(n, batch.payload)
    out["t_ns"], out["seq"], out["arrival_ns"] = wire["t_ns"], wire["seq"], arrival_ns
    out["sensor"], out["length"] = sensor, n
    out["flags"] = HAS_ARRIVAL | HAS_SEQ | (HAS_R if with_R else 0)
    out["z"][:, :kept] = wire["z"][:, :kept]
    if with_R:
        diagonal = np.arange(kept)
        out["R"][:, diagonal, diagonal] = wire["R"][:, :kept]
    return True


_WIRE_DTYPES: dict[tuple[int, bool], np.dtype[Any]] = {}


def _wire_dtype(n: int, with_R: bool) -> np.dtype[Any]:
    """dtype of one whole record; kept, since building one costs more than decoding a put."""
    found = _WIRE_DTYPES.get((n, with_R))
    if found is None:
        R_fields = [("R", "<f8", (n,))] if with_R else []
        fields = [
            ("head", "<u8"),
            ("seq", "<u8"),
            ("t_ns", "<i8"),
            ("z", "<f8", (n,)),
            *R_fields,
            ("crc", "<u4"),
        ]
        found = np.dtype(fields)
        if len(_WIRE_DTYPES) < 256:
            _WIRE_DTYPES[n, with_R] = found
    return found
