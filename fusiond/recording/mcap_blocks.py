"""Walking through an MCAP file, whole or cut short: metadata, and messages in the order written."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import numpy as np
from mcap.records import Channel, Message, Metadata
from mcap.stream_reader import StreamReader
from numpy.typing import NDArray

from fusiond.errors import LogError
from fusiond.recording.description import dtype_of
from fusiond.recording.mcap_writer import ENCODING

MAGIC = b"\x89MCAP0\r\n"
LARGEST_RECORD = 1 << 30


@dataclass(slots=True)
class McapFile:
    """One MCAP file, read from front to end in the order written; memory holds one chunk of it.

    Args:
        metadata: the metadata records met so far, by name.
        warnings: what is wrong with the file, in words; empty for one that was closed cleanly.
        messages: how many messages were read.
    """

    path: Path
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    messages: int = 0

    def open(self) -> IO[bytes]:
        """The file, after its magic was checked. Raises: LogError where it is missing or no MCAP."""
        try:
            file = self.path.open("rb")
        except OSError as error:
            raise LogError(
                f"{self.path}: cannot be read ({error.strerror}); name an existing recording"
            ) from error
        if file.read(len(MAGIC)) != MAGIC:
            file.close()
            raise LogError(f"{self.path}: is no MCAP file; `fusiond import` turns other recordings into one")
        file.seek(0)
        return file

    def walk(self) -> Iterator[tuple[Channel, Message]]:
        """Channel and message, in the order written.

        A file cut short (a crash, a copy in progress) or damaged ends the walk at the last whole chunk with a
        warning.
        """
        self.warnings.clear()
        self.messages = 0
        channels: dict[int, Channel] = {}
        with self.open() as file:
            records = StreamReader(file, validate_crcs=True, record_size_limit=LARGEST_RECORD).records
            while True:
                try:
                    record = next(records)
                except StopIteration:
                    return
                except Exception as error:
                    # The package passes on whatever its decompressors and struct raise, so no narrower class will do.
                    reason = str(error) or type(error).__name__
                    self.warnings.append(
                        f"{self.path.name}: cut short or damaged after {self.messages} messages ({reason}); "
                        "read up to there"
                    )
                    return
                if isinstance(record, Metadata):
                    self.metadata[record.name] = record.metadata
                elif isinstance(record, Channel):
                    channels[record.id] = record
                elif isinstance(record, Message) and record.channel_id in channels:
                    self.messages += 1
                    yield channels[record.channel_id], record

    def head(self) -> dict[str, str]:
        """The metadata record `fusiond`, empty for a file somebody else wrote."""
        with self.open() as file:
            records = StreamReader(file, record_size_limit=LARGEST_RECORD).records
            try:
                next(records)
                record = next(records)
            except Exception:
                # Whatever is wrong with the file, `walk` says so.
                return {}
        return record.metadata if isinstance(record, Metadata) and record.name == "fusiond" else {}

    def blocks(self, topic: str) -> Iterator[NDArray[Any]]:
        """The packed records of one topic, block by block, read only."""
        dtypes: dict[int, np.dtype[Any]] = {}
        for channel, message in self.walk():
            if channel.topic != topic or channel.message_encoding != ENCODING:
                continue
            if channel.id not in dtypes:
                dtypes[channel.id] = dtype_of(channel.metadata["dtype"])
            dtype = dtypes[channel.id]
            yield np.frombuffer(message.data, dtype, count=len(message.data) // dtype.itemsize)
