"""A growing batch of readings, filled by copying bytes: no Python object is kept for a number.

The bytes behind the array are `layout.reading` records, so a record on the wire reaches the engine by two copies.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.engine.records import HAS_ARRIVAL, HAS_R, HAS_SEQ

HEAD = Struct("<qqQiiq")
"""t_ns, arrival_ns, seq, sensor, length, flags: the scalars of `reading_dtype`, in its order."""
FIRST_CAPACITY = 1024


class ReadingBatch:
    """Readings of one round of the loop, in arrival order.

    Args:
        layout: gives the dtype; its scalars must come first, as `HEAD` has them (checked).
    """

    def __init__(self, layout: Layout) -> None:
        dtype = layout.reading
        fields: Any = dtype.fields
        assert fields["z"][1] == HEAD.size, "reading_dtype and HEAD disagree"
        self.count = 0
        self.payload = layout.shape.payload
        self._dtype = dtype
        self._size = dtype.itemsize
        self._r_at = int(fields["R"][1])
        # What follows the numbers of a reading, by how many of them are kept.
        rest = self._size - HEAD.size
        self._padding = [bytes(rest - 8 * kept) for kept in range(self.payload + 1)]
        self._allot(FIRST_CAPACITY)

    def clear(self) -> None:
        """Start over; views given out before are overwritten by what follows."""
        self.count = 0

    def view(self) -> NDArray[Any]:
        """The readings so far, valid until the next `clear`."""
        return self._first if self.count == 1 else self._array[: self.count]

    def reserve(self, more: int) -> NDArray[Any]:
        """The next `more` records, zeroed, to be filled by whole columns."""
        while self.count + more > self._capacity:
            self._grow()
        out = self._array[self.count : self.count + more]
        out[:] = np.zeros((), self._dtype)
        self.count += more
        return out

    def add(self, sensor: int, arrival_ns: int, t_ns: int, seq: int | None, z: bytes) -> None:
        """Append one reading.

        Args:
            z: little-endian f64 bytes of every number sent; what does not fit is dropped, the length is kept.
        """
        if self.count == self._capacity:
            self._grow()
        length = len(z) // 8
        flags = HAS_ARRIVAL if seq is None else HAS_ARRIVAL | HAS_SEQ
        head = HEAD.pack(t_ns, arrival_ns, seq or 0, sensor, length, flags)
        if length > self.payload:
            length = self.payload
            z = z[: 8 * length]
        at = self.count * self._size
        self._data[at : at + self._size] = head + z + self._padding[length]
        self.count += 1

    def add_covariance(self, rows: Sequence[Sequence[float]]) -> None:
        """Give the newest reading its own R, (n, n), in the squared units of z."""
        record = self._array[self.count - 1]
        kept = min(len(rows), self.payload)
        for i in range(kept):
            record["R"][i, :kept] = rows[i][:kept]
        record["flags"] |= HAS_R

    def add_variances(self, variances: Sequence[float]) -> None:
        """Give the newest reading a diagonal R, in the squared units of z."""
        record = self._array[self.count - 1]
        for i, variance in enumerate(variances[: self.payload]):
            record["R"][i, i] = variance
        record["flags"] |= HAS_R

    def _allot(self, capacity: int) -> None:
        self._capacity = capacity
        self._data = bytearray(capacity * self._size)
        self._array: NDArray[Any] = np.frombuffer(self._data, self._dtype)
        self._first = self._array[:1]

    def _grow(self) -> None:
        before = self._data
        self._allot(2 * self._capacity)
        self._data[: len(before)] = before
