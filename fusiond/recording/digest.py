"""Two runs are equal when their reports are: the hash over reports, arrival times left out."""

from __future__ import annotations

import hashlib
from typing import Any

from numpy.typing import NDArray


class OutputDigest:
    """SHA-256 over report records in the order produced, ticks' reports included, with `arrival_ns` set to 0.

    The bytes are those of the documented packed little-endian dtype; how reports are cut into blocks is
    without effect.
    """

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def update(self, reports: NDArray[Any]) -> None:
        """Append reports; the array is not changed."""
        block = reports.copy()
        block["arrival_ns"] = 0
        self._hash.update(block.data.cast("B"))

    def hexdigest(self) -> str:
        """The hash of everything so far."""
        return self._hash.hexdigest()
