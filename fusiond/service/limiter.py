"""How often something may happen: in data time for what is published, in clock time for what is said."""

from __future__ import annotations


class RateLimiter:
    """Lets pass at most `rate_hz` on average, without dropping every other one of a jittering stream of that rate.

    Args:
        rate_hz: largest average rate; infinite or 0: no limit.
    """

    def __init__(self, rate_hz: float) -> None:
        self.period_ns = round(1e9 / rate_hz) if 0 < rate_hz < 1e9 else 0
        self.due_ns: int | None = None

    def passes(self, t_ns: int) -> bool:
        """Whether one at this time may pass; if so it is counted. Time that jumped back starts over."""
        due_ns, period_ns = self.due_ns, self.period_ns
        if due_ns is None or t_ns < due_ns - 2 * period_ns:
            due_ns = t_ns
        if t_ns < due_ns - period_ns // 4:
            return False
        self.due_ns = max(due_ns, t_ns) + period_ns
        return True
