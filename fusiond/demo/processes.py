"""The demonstration's processes: started, listened to, and ended by their process id whatever happens."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import IO, Self

from fusiond.errors import FusiondError

PR_SET_PDEATHSIG = 1
KEPT_LINES = 40
"""Lines of stderr kept, to be shown where the process fails."""


class ProcessFailed(FusiondError):
    """Raised when a process of the demonstration did not do its part; the text ends with its last words."""


class Process:
    """One child process.

    Args:
        name: for messages.      command: program and arguments.
        orphan_safe: ask the kernel (Linux) to end it when this process dies without saying goodbye. Only before this
            process has threads: what runs between fork and exec must find no lock held.
    """

    def __init__(self, name: str, command: Sequence[str], *, orphan_safe: bool = False) -> None:
        self.name = name
        self._lines: SimpleQueue[str | None] = SimpleQueue()
        self._words: deque[str] = deque(maxlen=KEPT_LINES)
        # A session of its own: Ctrl-C reaches the demonstration alone, which then ends its processes in order.
        self._child = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            start_new_session=True, preexec_fn=_leave_with_parent() if orphan_safe else None,  # noqa: PLW1509 -- see above
        )  # fmt: skip
        assert self._child.stdout is not None
        assert self._child.stderr is not None
        self._readers = [
            _read(f"{name} stdout", self._child.stdout, self._lines.put),
            _read(
                f"{name} stderr", self._child.stderr, lambda line: self._words.append(line) if line else None
            ),
        ]

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._child.pid

    def lines(self) -> list[str]:
        """What it printed since the last call."""
        found: list[str] = []
        while True:
            try:
                line = self._lines.get_nowait()
            except Empty:
                return found
            if line is not None:
                found.append(line)

    def line(self, timeout_s: float) -> str:
        """The next line it prints. Raises: ProcessFailed where it ends, or says nothing in time."""
        try:
            line = self._lines.get(timeout=timeout_s)
        except Empty:
            raise self.failed(f"said nothing within {timeout_s:g} s") from None
        if line is None:
            raise self.failed(f"ended with status {self._child.wait()}")
        return line

    def running(self) -> bool:
        """Whether it has not ended."""
        return self._child.poll() is None

    def status(self, timeout_s: float) -> int:
        """Its exit status. Raises: ProcessFailed where it does not end in time."""
        try:
            return self._child.wait(timeout_s)
        except subprocess.TimeoutExpired:
            raise self.failed(f"did not end within {timeout_s:g} s") from None

    def check(self) -> None:
        """Raises: ProcessFailed where it has ended with an error."""
        if self._child.poll():
            raise self.failed(f"ended with status {self._child.returncode}")

    def failed(self, fact: str) -> ProcessFailed:
        """An error with what it wrote to stderr."""
        if not self.running():
            self._readers[1].join(1.0)
        words = "\n".join(f"  {line}" for line in self._words) or "  (nothing on stderr)"
        return ProcessFailed(f"demo: the {self.name} {fact}; its last words:\n{words}")

    def end(self, patience_s: float = 3.0) -> int:
        """Ask it to stop, then insist; returns its exit status."""
        if self.running():
            os.kill(self.pid, signal.SIGTERM)
        try:
            return self._child.wait(patience_s)
        except subprocess.TimeoutExpired:
            os.kill(self.pid, signal.SIGKILL)
            return self._child.wait()
        finally:
            for reader in self._readers:
                reader.join(1.0)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end()


def wait_until(true: Callable[[], bool], timeout_s: float, every_s: float = 0.05) -> bool:
    """Ask again and again; False where it did not become true in time."""
    deadline = time.monotonic() + timeout_s
    while not true():
        if time.monotonic() > deadline:
            return False
        time.sleep(every_s)
    return True


def _leave_with_parent() -> Callable[[], None] | None:
    """What a child calls between fork and exec, so that it gets SIGTERM when its parent dies."""
    if sys.platform != "linux":
        return None
    libc = ctypes.CDLL(None)
    return lambda: libc.prctl(PR_SET_PDEATHSIG, int(signal.SIGTERM)) and None


def _read(name: str, stream: IO[str], take: Callable[[str | None], object]) -> threading.Thread:
    """Hand every line on, then None."""

    def read() -> None:
        with stream:
            for line in stream:
                take(line.rstrip("\n"))
        take(None)

    thread = threading.Thread(target=read, name=name, daemon=True)
    thread.start()
    return thread
