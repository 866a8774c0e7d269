"""Between the reader threads and whoever works: arrivals in a bounded queue, and the baton.

Theory of operation. State is touched only by the holder of the baton, a lock that is never waited for by a reader: it
puts its arrival into the queue, and works off the queue itself if nobody else does. A thread of its own for the work
would cost every reading two wake-ups, as much as a Zenoh echo takes; this costs none, and order and ownership are the
same. A reader that finds the baton taken goes back to its ring: the holder looks at the queue again after letting go.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

import zenoh

Arrival = tuple[int, int, zenoh.Sample]
"""One put as a reader thread found it: arrival in ns, the subscription's place in `Intake`, the sample."""


class Mailbox:
    """Arrivals waiting for the holder of the baton.

    Args:
        capacity: arrivals it holds; beyond it the oldest is dropped and counted.
        work: takes arrivals, in order, while the baton is held.
        most: arrivals given to `work` at once.
    """

    def __init__(self, capacity: int, work: Callable[[list[Arrival]], None], most: int = 512) -> None:
        self.capacity = capacity
        self.dropped = 0
        self.baton = threading.Lock()
        self._work = work
        self._most = most
        self._queue: deque[Arrival] = deque(maxlen=capacity)

    def __len__(self) -> int:
        return len(self._queue)

    def put(self, arrival: Arrival) -> None:
        """Add one; never waits."""
        if len(self._queue) == self.capacity:
            self.dropped += 1
        self._queue.append(arrival)

    def hand_over(self, arrival: Arrival) -> None:
        """Add one and work it off; at once, past the queue, where nothing waits in it and nobody works."""
        if self._queue or not self.baton.acquire(blocking=False):
            self.put(arrival)
        else:
            try:
                self._work([arrival])
            finally:
                self.baton.release()
        if self._queue:
            self.work_off()

    def work_off(self) -> None:
        """Work while something waits and nobody else works; returns at once otherwise."""
        while self._queue and self.baton.acquire(blocking=False):
            try:
                self._work(self._take())
            finally:
                self.baton.release()

    def drain(self) -> None:
        """Work while something waits; called with the baton."""
        while self._queue:
            self._work(self._take())

    def _take(self) -> list[Arrival]:
        """What waits, at most `most`. Only the holder of the baton takes; a full queue drops one only for another."""
        queue = self._queue
        if len(queue) == 1:
            return [queue.popleft()]
        return [queue.popleft() for _ in range(min(len(queue), self._most))]
