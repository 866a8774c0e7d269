"""Time that passes while nothing comes: where no accepted reading says how late it is, a tick does."""

from __future__ import annotations

from typing import Any


class Ticks:
    """When a tick is due, and its stamp.

    Args:
        desk: the engine's; has stamp and arrival of the newest reading that was accepted.   tick_hz: how often.
    """

    def __init__(self, desk: Any, tick_hz: float) -> None:
        self.due_ns = 0
        self._desk = desk
        self._period_ns = round(1e9 / tick_hz)

    def stamp_ns(self, now_ns: int) -> int | None:
        """The newest stamp plus what passed since it came; None before the first, or where it came just now."""
        self.due_ns = now_ns + self._period_ns
        if not self._desk["has_arrival"][0]:
            return None
        passed_ns = now_ns - int(self._desk["newest_arrival_ns"][0])
        if passed_ns < self._period_ns:
            self.due_ns -= passed_ns
            return None
        return int(self._desk["newest_t_ns"][0]) + passed_ns
