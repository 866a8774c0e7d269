"""Recording beside the loop: whoever puts never waits; what finds the queue full is dropped, counted and
told.

A `collections.deque` is the queue: append and popleft are atomic, so the putting thread takes no lock. One
thread drains it, gathers single records into blocks, and hands them to the operating system at least every
`flush_s`.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.recording.mcap_writer import BLOCK, McapWriter

POLL_S = 0.05
"""Longest time the draining thread sleeps while there may be work."""
CAPACITY = 1 << 16
"""Items (puts) the queue holds: at 20,000 puts a second some three seconds of a stalled disk."""


class BackgroundWriter:
    """Writes one recording from a thread of its own.

    Args:
        writer: where to; this object closes it.
        capacity: most items waiting.
        flush_s: longest time between a put and the operating system having it, while the disk keeps up.
    Fields for status: `dropped` (records and messages lost, by kind), `error` (why writing stopped, empty
    while it works).
    """

    def __init__(self, writer: McapWriter, *, capacity: int = CAPACITY, flush_s: float = 0.5) -> None:
        self.writer = writer
        self.dropped: dict[str, int] = {"readings": 0, "reports": 0, "messages": 0}
        self.error = ""
        self._capacity = capacity
        self._flush_s = flush_s
        self._queue: deque[tuple[str, Any]] = deque()
        self._gathered: dict[str, list[bytes]] = {"readings": [], "reports": []}
        self._dtypes: dict[str, np.dtype[Any]] = {
            "readings": writer.layout.reading,
            "reports": writer.layout.report,
        }
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._work, name="fusiond-recording", daemon=True)
        self._thread.start()

    def put_readings(self, block: NDArray[Any]) -> bool:
        """Queue a copy of readings and ticks, in arrival order; False where they were dropped. Never waits."""
        return self._put("readings", block, len(block))

    def put_reports(self, block: NDArray[Any]) -> bool:
        """Queue a copy of reports, in the order produced; False where they were dropped. Never waits."""
        return self._put("reports", block, len(block))

    def put_message(self, topic: str, payload: bytes, t_ns: int, log_time_ns: int) -> bool:
        """Queue a published JSON message; False where it was dropped. Never waits."""
        return self._put("messages", (topic, payload, t_ns, log_time_ns), 1)

    def close(self, timeout_s: float = 5.0) -> bool:
        """Write what is queued, finish the file, end the thread.

        Returns: True where the file is finished and nothing was dropped.
        """
        self._stop.set()
        self._thread.join(timeout_s)
        return not (self._thread.is_alive() or self.error or any(self.dropped.values()))

    def _put(self, kind: str, item: Any, number: int) -> bool:
        if self.error or len(self._queue) >= self._capacity or self._stop.is_set():
            self.dropped[kind] += number
            return False
        self._queue.append((kind, item.tobytes() if isinstance(item, np.ndarray) else item))
        return True

    def _work(self) -> None:
        due = time.monotonic() + self._flush_s
        try:
            while not self._stop.wait(POLL_S):
                self._drain()
                if time.monotonic() >= due:
                    self._flush()
                    due = time.monotonic() + self._flush_s
            self._drain()
            self._flush()
        except Exception as error:
            # A full disk must not end the daemon: the recording ends here, and says so.
            self.error = f"recording {self.writer.path.name}: stopped ({error}); free space, then start again"
            self._forget()
        self._finish()

    def _drain(self) -> None:
        for _ in range(len(self._queue)):
            kind, item = self._queue.popleft()
            if kind == "messages":
                self.writer.message(item[0], item[1], item[2], item[3])
                continue
            gathered = self._gathered[kind]
            gathered.append(item)
            if len(gathered) >= BLOCK:
                self._write(kind)

    def _write(self, kind: str) -> None:
        gathered = self._gathered[kind]
        if gathered:
            # Joined bytes, not concatenated arrays: a hundredth of the time during which the loop stands still for us.
            getattr(self.writer, kind)(np.frombuffer(b"".join(gathered), self._dtypes[kind]))
            gathered.clear()

    def _flush(self) -> None:
        self._write("readings")
        self._write("reports")
        self.writer.flush()

    def _forget(self) -> None:
        """Count as dropped what was queued when writing failed."""
        for kind, gathered in self._gathered.items():
            self.dropped[kind] += sum(map(len, gathered)) // self._dtypes[kind].itemsize
            gathered.clear()
        while self._queue:
            kind, item = self._queue.popleft()
            self.dropped[kind] += 1 if kind == "messages" else len(item) // self._dtypes[kind].itemsize

    def _finish(self) -> None:
        dropped = {f"dropped_{kind}": number for kind, number in self.dropped.items()}
        try:
            self.writer.close(**dropped, **({"error": self.error} if self.error else {}))
        except Exception as error:
            self.error = (
                self.error or f"recording {self.writer.path.name}: not finished ({error}); it still reads"
            )
