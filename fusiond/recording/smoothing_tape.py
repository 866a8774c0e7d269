"""A tape of records, written forwards and read in either direction: in memory while it is short, then on disk."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.errors import LogError

IN_MEMORY_BYTES = 256 << 20
"""A longer tape goes to the temporary folder, which gives the space back when the tape is closed."""
ROWS = 4096
"""Most records read at once."""


class Tape:
    """Records of one dtype; closed by the caller.

    Args:
        in_memory_bytes: longest tape held in memory.
    """

    def __init__(self, dtype: np.dtype[Any], in_memory_bytes: int = IN_MEMORY_BYTES) -> None:
        self.dtype = dtype
        self.rows = 0
        self._file = tempfile.SpooledTemporaryFile(max_size=in_memory_bytes)  # noqa: SIM115 closed by `close`

    def append(self, block: NDArray[Any]) -> None:
        """Add records at the end. Raises LogError where the disk is full."""
        try:
            self._file.seek(self.rows * self.dtype.itemsize)
            self._file.write(np.ascontiguousarray(block, self.dtype).tobytes())
        except OSError as error:
            needed = (self.rows + len(block)) * self.dtype.itemsize / 2**20
            raise LogError(
                f"--smooth: {needed:.0f} MiB and more do not fit into {tempfile.gettempdir()} ({error.strerror}); "
                "name a folder with more room in TMPDIR, or smooth a shorter log"
            ) from error
        self.rows += len(block)

    def forwards(self) -> Iterator[NDArray[Any]]:
        """Blocks from the first record to the last."""
        for begin in range(0, self.rows, ROWS):
            yield self._read(begin, min(begin + ROWS, self.rows))

    def backwards(self) -> Iterator[NDArray[Any]]:
        """Blocks from the last record to the first, each itself reversed."""
        for stop in range(self.rows, 0, -ROWS):
            yield self._read(max(0, stop - ROWS), stop)[::-1]

    def close(self) -> None:
        """Give the space back."""
        self._file.close()

    def _read(self, begin: int, stop: int) -> NDArray[Any]:
        self._file.seek(begin * self.dtype.itemsize)
        return np.frombuffer(self._file.read((stop - begin) * self.dtype.itemsize), self.dtype)
