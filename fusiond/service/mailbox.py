"""The one bounded queue between reader threads and the fusion thread.

Built on `queue.SimpleQueue`, whose `put` is a single C call: cheap enough for every reading, and safe in a signal
handler. The oldest give way when it is full, since a fresh reading is worth more than a complete past.
"""

from __future__ import annotations

from queue import Empty, SimpleQueue
from typing import NamedTuple

import zenoh


class Arrival(NamedTuple):
    """One put as a reader thread found it. `route`: the subscription's place in `Intake`."""

    arrival_ns: int
    route: int
    sample: zenoh.Sample


class Mailbox:
    """Arrivals for one taker.

    Args:
        capacity: arrivals it holds; beyond it the oldest is dropped and counted.
    """

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self.dropped = 0
        self._queue: SimpleQueue[Arrival | None] = SimpleQueue()

    def __len__(self) -> int:
        return self._queue.qsize()

    def put(self, arrival: Arrival) -> None:
        """Add one; never waits."""
        queue = self._queue
        if queue.qsize() >= self.capacity:
            try:
                queue.get_nowait()
                self.dropped += 1
            except Empty:
                pass
        queue.put(arrival)

    def ring(self) -> None:
        """Wake the taker without an arrival; allowed in a signal handler."""
        self._queue.put(None)

    def take(self, timeout_s: float, limit: int) -> list[Arrival]:
        """Wait until something comes or the time is over, then take what is there, at most `limit`."""
        queue = self._queue
        taken: list[Arrival | None] = []
        try:
            taken.append(queue.get(timeout=timeout_s) if timeout_s > 0 else queue.get_nowait())
            for _ in range(min(queue.qsize(), limit - 1)):
                taken.append(queue.get_nowait())
        except Empty:
            pass
        return [arrival for arrival in taken if arrival is not None]
