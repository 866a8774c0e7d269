"""A relay in front of a sensor: what it hears it sends on, with the faults that are on.

Sequence numbers, stamps, covariances, encoding, attachment and quality of service stay what they were, and a put that
no fault meets goes on byte for byte. What cannot be read is sent on as it is, unless nothing is sent at all (`broken`).
"""

from __future__ import annotations

import json
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Any

import numpy as np

from fusiond.errors import ConfigError
from fusiond.simulation.faults import Fault, Kind, parse_fault
from fusiond.simulation.faults_injection import Measured, SensorFaults
from fusiond.types import NANOSECONDS, Slot
from tools.inject_payloads import Piece, open_put, same

CONTROL = "@inject"
"""First chunk of the keys on which relays take commands; no wildcard of anybody else meets it."""


@dataclass(slots=True)
class Relay:
    """One sensor on its way to a daemon. Puts and commands may come from different threads.

    Args:
        clock_ns: monotonic; START counts from now, on the sensor's own clock.
        slots: the sensor's channels where they are known.      warn: says what an operator should know, once.
    """

    sensor: Measured
    seed: int
    clock_ns: Callable[[], int]
    slots: tuple[Slot, ...] = ()
    warn: Callable[[str], None] = lambda text: None
    faults: SensorFaults = field(init=False)
    counts: dict[str, int] = field(
        default_factory=lambda: dict.fromkeys(("heard", "sent", "altered", "withheld", "unread"), 0)
    )
    _began_ns: int = field(init=False)
    _newest_ns: int | None = None
    _warned: set[str] = field(default_factory=set)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def __post_init__(self) -> None:
        self.faults = SensorFaults(self.sensor, (), self.seed, None, ready=True)
        self._began_ns = self.clock_ns()

    @property
    def elapsed_ns(self) -> int:
        """Since the relay began."""
        return self.clock_ns() - self._began_ns

    def pass_on(self, encoding: str, payload: bytes) -> bytes | None:
        """What is sent instead of a put; None where nothing is."""
        put = open_put(encoding, payload, self.slots)
        with self._lock:
            pieces = [Piece(payload)] if put is None else put.pieces
            self.counts["heard"] += len(pieces)
            parts: list[bytes | None] = []
            for width, group in groupby(pieces, lambda one: -1 if one.t_ns is None else len(one.z)):
                alike = list(group)
                parts += self._unread(alike) if width < 0 else self._lied(alike, width)
            sent = [part for part in parts if part is not None]
            self.counts["sent"] += len(sent)
        if not sent:
            return None if pieces else payload
        untouched = len(sent) == len(pieces) and all(
            part is one.raw for part, one in zip(sent, pieces, strict=True)
        )
        return payload if put is None or untouched else put.join(sent)

    def command(self, question: Mapping[str, Any]) -> dict[str, Any]:
        """Answer `set`, `clear` or `list`; never raises."""
        answer: dict[str, Any] = {"sensor": self.sensor.name}
        with self._lock:
            try:
                answer["done"] = self._obey(str(question.get("command")), str(question.get("spec", "")))
            except ConfigError as mistake:
                answer["mistake"] = str(mistake)
            answer["elapsed_s"] = self.elapsed_ns / NANOSECONDS
            answer["faults"] = [str(fault) for fault in self.faults.faults]
            answer["counts"] = dict(self.counts)
        return answer

    def set(self, specification: str) -> Fault:
        """Switch a fault on: at START, or now where there is none. Raises: ConfigError."""
        what, at, when = specification.strip().partition("@")
        now = not at or when == "now" or when.startswith("now+")
        fault = parse_fault(f"{what}@0{when.removeprefix('now')}" if now else specification)
        if fault.sensor != self.sensor.name:
            raise ConfigError(
                f"inject {specification}: this relay is in front of {self.sensor.name}; name that sensor"
            )
        if now and self._newest_ns is not None and self.faults.origin_ns is not None:
            fault = replace(fault, start_ns=max(0, self._newest_ns - self.faults.origin_ns))
        elif now:
            fault = replace(fault, start_ns=self.elapsed_ns)
        self.faults.add(fault)
        return fault

    def clear(self, which: str) -> list[Fault]:
        """Switch faults off: all, or those a text names (`gps`, `gps.bias`, `gps.0.bias=5`, a whole specification)."""
        gone = [fault for fault in self.faults.faults if not which or which in _names(fault)]
        self.faults.clear(gone)
        return gone

    def _obey(self, command: str, specification: str) -> list[str]:
        if command == "set":
            return [str(self.set(specification))]
        if command == "clear":
            return [str(fault) for fault in self.clear(specification)]
        return []

    def _unread(self, pieces: list[Piece]) -> list[bytes | None]:
        """What has no stamp: it is sent on, or met by what withholds everything at this time."""
        now_ns = self.elapsed_ns
        met = any(
            fault.kind is Kind.BROKEN and fault.start_ns <= now_ns < fault.end_ns
            for fault in self.faults.faults
        )
        self.counts["unread"] += len(pieces)
        self._warn_once("sends what is neither records nor JSON; it is passed on, and only `broken` meets it")
        if met:
            self.counts["withheld"] += len(pieces)
        return [None if met else one.raw for one in pieces]

    def _lied(self, pieces: list[Piece], width: int) -> list[bytes | None]:
        """Readings of one length."""
        t_ns = np.array([one.t_ns for one in pieces], np.int64)
        self.faults.start(int(t_ns[0]) - self.elapsed_ns)
        self._newest_ns = int(t_ns[-1])
        self._learn(pieces[-1], width)
        z = np.array([one.z for one in pieces], np.float64).reshape(len(pieces), width)
        lies, keep = self.faults.apply(t_ns, z, self._deviations(pieces, width))
        parts: list[bytes | None] = []
        for one, lie, kept in zip(pieces, lies.tolist(), keep.tolist(), strict=True):
            if not kept:
                self.counts["withheld"] += 1
                parts.append(None)
            elif one.other is None or all(map(same, one.z, lie)):
                parts.append(one.raw)
            else:
                self.counts["altered"] += 1
                parts.append(one.other(lie))
        return parts

    def _learn(self, piece: Piece, width: int) -> None:
        """How many numbers it sends, and how noisy it says they are."""
        variances = piece.variances
        self.faults.learn(width, None if variances is None else tuple(np.sqrt(np.abs(variances)).tolist()))
        for fault in self.faults.faults:
            if fault.channel is not None and fault.channel >= width:
                self._warn_once(f"sends {width} numbers; {fault} meets none of them")

    def _warn_once(self, text: str) -> None:
        if text not in self._warned:
            self._warned.add(text)
            self.warn(f"inject: {self.sensor.name} {text}")

    def _deviations(self, pieces: list[Piece], width: int) -> np.ndarray[Any, np.dtype[np.float64]] | None:
        """(k, width) standard deviations where a reading brings its own R."""
        if not any(one.variances for one in pieces):
            return None
        configured = np.zeros(width)
        known = (self.sensor.sigma or ())[:width]
        configured[: len(known)] = known
        rows = [
            configured
            if one.variances is None or len(one.variances) != width
            else np.sqrt(np.abs(one.variances))
            for one in pieces
        ]
        return np.array(rows)


def _names(fault: Fault) -> set[str]:
    """How an operator may call a fault that is on."""
    whole = str(fault)
    what = whole.partition("@")[0]
    return {whole, what, what.partition("=")[0], f"{fault.sensor}.{fault.kind}", fault.sensor}


def answer_of(relay: Relay, to: str, payload: bytes) -> bytes:
    """The relay's answer to a question on its control key."""
    try:
        question = json.loads(payload)
    except ValueError:
        question = {}
    if not isinstance(question, dict):
        question = {}
    return json.dumps({"to": to, **relay.command(question)}).encode()
