"""The watchdog of commands: when the loop gives none for too long, the safe command goes out.

It looks at nothing but how many commands went out, and at the clock. It begins with the first command, repeats itself
while the loop is late, and ends by itself with the next command.
"""

from __future__ import annotations

import threading

from fusiond.service.clock import Clock
from fusiond.service.command_output import CommandOutput

LOOKS = 4
"""Looks in a deadline."""


class CommandWatch:
    """A thread that looks whether commands go out.

    Args:
        deadline_ns: longest time without one.
    """

    def __init__(self, output: CommandOutput, deadline_ns: int, clock: Clock) -> None:
        self._output, self._deadline_ns, self._clock = output, deadline_ns, clock
        self._seen, self._seen_ns = output.count, clock.now_ns()
        self._late = False
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="commands", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def close(self, timeout_s: float) -> bool:
        """End; whether the thread did."""
        self._ended.set()
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def look(self, now_ns: int) -> bool:
        """One look; whether the safe command went out."""
        count = self._output.count
        if count != self._seen:
            self._seen, self._seen_ns = count, now_ns
            self._late = False
            return False
        if now_ns - self._seen_ns <= self._deadline_ns and not self._late:
            return False
        if not self._output.retreat(count, now_ns - self._seen_ns):
            return False
        self._late, self._seen = True, count + 1
        return True

    def _watch(self) -> None:
        while not self._ended.wait(self._deadline_ns / LOOKS / 1e9):
            self.look(self._clock.now_ns())
