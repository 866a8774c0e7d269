"""The daemon's clock: wall-clock nanoseconds that advance with the monotonic clock, so a step of NTP moves nothing."""

from __future__ import annotations

import time


class Clock:
    """Nanoseconds since 1970, by one offset taken at the start."""

    def __init__(self) -> None:
        self.offset_ns = time.time_ns() - time.monotonic_ns()

    def now_ns(self) -> int:
        """Now."""
        return time.monotonic_ns() + self.offset_ns
