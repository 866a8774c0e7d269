"""Reader threads: one ring and one thread for each subscription, all into one mailbox.

A ring never makes Zenoh wait: when a thread is late the oldest sample gives way, which shows as a gap in `seq`.
"""

from __future__ import annotations

import threading
from collections.abc import Iterable

import zenoh

from fusiond.engine.layout import Layout
from fusiond.service.clock import Clock
from fusiond.service.mailbox import Mailbox
from fusiond.service.wire import IGNORED, UNKNOWN

AT_ONCE = 256
"""Samples taken from a ring before the work on them begins."""


class Intake:
    """The subscriptions of one daemon and what their keys mean.

    Args:
        session: takes the readings.
        prefix: the namespace; `PREFIX/sensor/*`, `PREFIX/reference` and `PREFIX/applied` are always listened to.
        keys: key expression of every configured sensor, by name.
        ring: samples each ring holds.
    """

    def __init__(
        self, session: zenoh.Session, layout: Layout, prefix: str, keys: dict[str, str], ring: int,
        mailbox: Mailbox, clock: Clock,
    ) -> None:  # fmt: skip
        self._clock = clock
        self._mailbox = mailbox
        self._sensors = [(zenoh.KeyExpr(key), layout.numbers[name]) for name, key in keys.items()]
        self._expressions = subscriptions(prefix, keys.values())
        self._sensor_of: list[dict[str, int]] = [{} for _ in self._expressions]
        self._subscribers = [
            session.declare_subscriber(e, zenoh.handlers.RingChannel(ring)) for e in self._expressions
        ]
        self._threads = [
            threading.Thread(target=self._read, args=(i,), name=f"read {e}", daemon=True)
            for i, e in enumerate(self._expressions)
        ]
        for thread in self._threads:
            thread.start()

    def sensor_of(self, route: int, sample: zenoh.Sample) -> int:
        """Sensor number of a sample, UNKNOWN, or IGNORED."""
        key = str(sample.key_expr)
        known = self._sensor_of[route]
        found = known.get(key)
        if found is None:
            found = self._resolve(route, zenoh.KeyExpr(key))
            if found >= 0:
                known[key] = found
        return found

    def join(self, timeout_s: float) -> bool:
        """Wait for the threads, which end when their session is closed. False where one did not."""
        for thread in self._threads:
            thread.join(timeout_s)
        return not any(thread.is_alive() for thread in self._threads)

    def _resolve(self, route: int, key: zenoh.KeyExpr) -> int:
        for expression, number in self._sensors:
            if expression.intersects(key):
                owner = next(i for i, e in enumerate(self._expressions) if e.intersects(key))
                return number if owner == route else IGNORED
        return UNKNOWN

    def _read(self, route: int) -> None:
        ring, hand_over, work_off = self._subscribers[route], self._mailbox.hand_over, self._mailbox.work_off
        try:
            while True:
                sample = ring.recv()
                hand_over((self._clock.now_ns(), route, sample))
                # Only where more has come meanwhile is it worth gathering before the next round of work.
                while self._gather(route):
                    work_off()
        except zenoh.ZError:
            return

    def _gather(self, route: int) -> bool:
        """Take what the ring holds, within bounds; whether there was anything."""
        ring, put, now_ns = self._subscribers[route], self._mailbox.put, self._clock.now_ns
        for k in range(AT_ONCE):
            sample = ring.try_recv()
            if sample is None:
                return k > 0
            put((now_ns(), route, sample))
        return True


def subscriptions(prefix: str, keys: Iterable[str]) -> list[zenoh.KeyExpr]:
    """The fewest key expressions that cover every sensor's, and everything under the sensors' prefix."""
    found = [zenoh.KeyExpr(f"{prefix}/{end}") for end in ("sensor/*", "reference", "applied")]
    for key in keys:
        expression = zenoh.KeyExpr(key)
        if not any(one.includes(expression) for one in found):
            found.append(expression)
    return found
