"""Commands on `control`: numbered, with their age, and the safe one when the loop is late.

Commands come from whoever holds the baton. The watchdog has a thread of its own, since whoever is late holds the baton.
Both number their messages here, one at a time, so that an actuator meets every number once and in order.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import zenoh

from fusiond.control.levels import Level, Safe, safe_command
from fusiond.engine.layout import Layout
from fusiond.numerics.kernel import interpreted
from fusiond.service import output_record
from fusiond.service.lease import Lease
from fusiond.service.messages import ControlMessage, Message, dumps
from fusiond.service.outlet import JSON, declare

SAFE = int(Level.SAFE)
Say = Callable[[str, bytes, int], None]
Heed = Callable[[str, Message], None]
"""Told of every estimate and command, also of those that are not sent since another daemon speaks."""


@dataclass(frozen=True, slots=True)
class Fallback:
    """The safe command as configured: mode, what it goes to, and how long the ramp takes."""

    mode: int = int(Safe.HOLD)
    values: tuple[float, ...] = ()
    ramp_ns: int = 1

    def at(self, last: Sequence[float], since_ns: int) -> tuple[float, ...]:
        """The safe command so long after the last one."""
        number = interpreted(safe_command)
        pairs = zip(last, self.values or (0.0,) * len(last), strict=True)
        return tuple(number(self.mode, u, u, safe, since_ns, self.ramp_ns) for u, safe in pairs)


def fallback_of(design: Any) -> Fallback:
    """The safe command of a design record."""
    values = tuple(float(one) for one in design["safe_command"])
    return Fallback(int(design["safe_mode"]), values, max(int(design["safe_ramp_ns"]), 1))


class CommandOutput:
    """The publisher of `control`.

    Args:
        lease: says whether anything goes out.   packed: as records instead of JSON.
        fallback: what goes out while the loop is late.
        say: told of every command (the recording); the watchdog's are not the engine's, and not told.
        heed: told of every command of the engine, also of those not sent since another daemon speaks.
        costs: what a message says of the cost, empty where nothing is known.
    """

    def __init__(
        self, session: zenoh.Session, layout: Layout, prefix: str, *, lease: Lease, packed: bool, fallback: Fallback,
        say: Say | None = None, heed: Heed | None = None, costs: Callable[[], dict[str, Any]] | None = None,
    ) -> None:  # fmt: skip
        self.level: str | None = None
        self.missed = 0
        self._message, self._lease, self._packed = ControlMessage(layout), lease, packed
        self._fallback, self._say, self._costs, self._heed = fallback, say, costs, heed
        encoding = output_record.CONTROL_ENCODING if packed else JSON
        self._publisher = declare(session, f"{prefix}/control", encoding, zenoh.Priority.REAL_TIME, lease)
        self._lock = threading.Lock()
        self._seq = 0
        self._last: tuple[int, tuple[float, ...], bool, float, int] | None = None

    def send(self, t_ns: int, u: tuple[float, ...], valid: bool, age_s: float, service: int) -> None:
        """Send the engine's command; one that is not valid is at the level `safe`, whatever the service's health."""
        level = service if valid else SAFE
        with self._lock:
            self._last = (t_ns, u, valid, age_s, level)
            payload = self._put(t_ns, u, valid, age_s, level)
        if self._say:
            self._say("control", payload, t_ns)
        if self._heed is not None:
            self._heed("control", {"t_ns": t_ns, "seq": self._seq, "u": u})

    @property
    def count(self) -> int:
        """Commands of the engine and of the watchdog so far."""
        return self._seq

    def repeat(self) -> None:
        """Send the last command, which was not sent when it was given, under its own number."""
        with self._lock:
            if self._last is not None:
                self._seq -= 1
                self._put(*self._last)

    def shift(self, by: int) -> None:
        """Number what follows higher, or lower."""
        with self._lock:
            self._seq += by

    def retreat(self, count: int, since_ns: int) -> bool:
        """Send the safe command, as so long after the last of the engine; not where another has gone out since `count`.

        Returns: whether it went out.
        """
        with self._lock:
            if self._last is None or self._seq != count or not self._lease.valid:
                return False
            t_ns, u, _, age_s, _ = self._last
            values = self._fallback.at(u, since_ns)
            self._put(t_ns + since_ns, values, False, age_s + since_ns / 1e9, SAFE)
            self.missed += 1
            return True

    def _put(self, t_ns: int, u: tuple[float, ...], valid: bool, age_s: float, level: int) -> bytes:
        self._seq += 1
        self.level = Level(level).label
        if self._packed:
            record = output_record.encode_control(t_ns, self._seq, self._lease.epoch, u, valid, age_s, level)
            self._publisher.put(record)
            if not self._say:
                return record
        message = self._message.content(t_ns, self._seq, self._lease.epoch, u, valid, age_s, level)
        if self._costs is not None:
            message |= self._costs()
        payload: bytes = dumps(message)
        if not self._packed:
            self._publisher.put(payload)
        return payload
