"""A consumer: the newest estimate or command with its age, or one after the other."""

from __future__ import annotations

import json
import threading
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import zenoh

from fusiond.service import output_record
from fusiond.service.endpoints import checked_key
from fusiond.service.sessions import DEFAULT_ENDPOINT, Endpoints, join

KEPT = 4096
"""Messages kept for iteration; the oldest give way."""


@dataclass(frozen=True, slots=True)
class Message:
    """One message as it came.

    Args:
        content: the JSON object.      arrival_ns: of the monotonic clock.
    """

    content: dict[str, Any]
    arrival_ns: int

    @property
    def age_s(self) -> float:
        """Time since it arrived."""
        return (time.monotonic_ns() - self.arrival_ns) / 1e9

    def __getitem__(self, name: str) -> Any:
        return self.content[name]


class TopicSubscriber:
    """Follows one topic of a daemon; a context manager, and an iterator over what comes.

    A message of an older epoch than one already seen (a daemon that was replaced) is left out, as is one that cannot
    be read (`unreadable` counts those).

    Args:
        name: the configuration's.
        topic: `estimate`, `control`, `health`, `event`, `report/SENSOR`, `local/SENSOR`.
        connect: endpoint of the daemon or router, or those of all daemons of a group.
        session: an open session to share; it is left open.
    Raises: ConfigError where `connect` is no endpoint or the key none; ConnectionFailed where nobody answers in time.
    """

    def __init__(
        self, name: str, topic: str, connect: Endpoints = DEFAULT_ENDPOINT, *, namespace: str | None = None,
        session: zenoh.Session | None = None,
    ) -> None:  # fmt: skip
        self.unreadable = 0
        self._latest: Message | None = None
        self._messages: deque[Message] = deque(maxlen=KEPT)
        self._came = threading.Condition()
        self._closed = False
        self._epoch = 0
        self._own = session is None
        key = checked_key(f"{namespace or f'fusiond/{name}'}/{topic}", f"{name}: {topic}")
        self.session = session or join(connect)
        self._subscriber = self.session.declare_subscriber(
            key, zenoh.handlers.Callback(self._take, indirect=False)
        )

    def latest(self) -> Message | None:
        """The newest message, None before the first."""
        return self._latest

    def next(self, timeout_s: float) -> Message | None:
        """The next message not yet taken by this or by iteration; None where none comes in time."""
        deadline = time.monotonic() + timeout_s
        with self._came:
            while not self._messages and not self._closed:
                left = deadline - time.monotonic()
                if left <= 0 or not self._came.wait(left):
                    break
            return self._messages.popleft() if self._messages else None

    def __iter__(self) -> Iterator[Message]:
        while not self._closed:
            message = self.next(0.5)
            if message is not None:
                yield message

    def close(self) -> None:
        """Stop following; iteration ends."""
        if not self._closed:
            self._closed = True
            if not self.session.is_closed():
                self._subscriber.undeclare()
                if self._own:
                    self.session.close()
            with self._came:
                self._came.notify_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _take(self, sample: zenoh.Sample) -> None:
        arrival_ns = time.monotonic_ns()
        payload = sample.payload.to_bytes()
        try:
            packed = str(sample.encoding) in output_record.OUTPUT_ENCODINGS
            content = output_record.decode_output(payload) if packed else json.loads(payload)
            epoch = int(content["epoch"])
        except (ValueError, TypeError, KeyError, RecursionError):
            self.unreadable += 1
            return
        if epoch < self._epoch:
            return
        self._epoch = epoch
        message = Message(content, arrival_ns)
        with self._came:
            self._latest = message
            self._messages.append(message)
            self._came.notify_all()


class EstimateSubscriber(TopicSubscriber):
    """Follows `estimate`: `{t, t_ns, seq, epoch, resets, jump{}, state{}, std{}, health, unobserved[]}`."""

    def __init__(self, name: str, connect: Endpoints = DEFAULT_ENDPOINT, **others: Any) -> None:
        super().__init__(name, "estimate", connect, **others)


class ControlSubscriber(TopicSubscriber):
    """Follows `control`: `{t, t_ns, seq, epoch, u{}, valid, age_s, level}`."""

    def __init__(self, name: str, connect: Endpoints = DEFAULT_ENDPOINT, **others: Any) -> None:
        super().__init__(name, "control", connect, **others)
