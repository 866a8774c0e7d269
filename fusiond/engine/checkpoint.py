"""A checkpoint: all that an engine remembers, as bytes. Another engine of the same configuration goes on from them.

`<4sI` magic `FUSK`, length of the head; the head as JSON: identity of the configuration, notes of whoever made it, and
name and items of every record; the records' bytes one after the other; u32 CRC-32 of all before.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from struct import Struct
from typing import Any

import numpy as np

from fusiond.engine.engine import Engine

HEAD = Struct("<4sI")
CRC = Struct("<I")
MAGIC = b"FUSK"


def checkpoint(engine: Engine, identity: str, notes: Mapping[str, Any]) -> bytes:
    """All that an engine remembers now.

    Args:
        identity: of its configuration.   notes: what else is to be handed on, as JSON can say it.
    """
    memory = engine.memory()
    items = [[name, len(records)] for name, records in memory.items()]
    head = json.dumps({"identity": identity, "notes": notes, "records": items}).encode()
    body = b"".join([HEAD.pack(MAGIC, len(head)), head, *(records.tobytes() for records in memory.values())])
    return body + CRC.pack(zlib.crc32(body))


def resume(engine: Engine, data: bytes, identity: str) -> Any:
    """Let an engine go on from a checkpoint; returns the notes in it.

    Raises: ValueError where the bytes are none, were changed on the way, or are of another configuration; the engine
    is as it was before then.
    """
    size = len(data) - CRC.size
    if size < HEAD.size or zlib.crc32(data[:size]) != CRC.unpack_from(data, size)[0]:
        raise ValueError("not a sound checkpoint")
    magic, length = HEAD.unpack_from(data)
    if magic != MAGIC:
        raise ValueError("not a checkpoint")
    head = json.loads(data[HEAD.size : HEAD.size + length])
    if head["identity"] != identity:
        raise ValueError("of another configuration or version")
    at, found = HEAD.size + length, {}
    for name, records in engine.memory().items():
        count = dict(head["records"])[name]
        found[name] = np.frombuffer(data, records.dtype, count, at)
        at += found[name].nbytes
    engine.remember(found)
    return head["notes"]
