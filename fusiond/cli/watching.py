"""`fusiond watch`: a running daemon on the terminal: estimate, health, what is wrong, and what happened lately."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import orjson
from rich.console import Console
from rich.live import Live

from fusiond.cli.watch_view import HEIGHT, WIDTH, event_text, panel, plain_line
from fusiond.errors import ConnectionFailed, FusiondError
from fusiond.service.ask import ask
from fusiond.service.subscribers import TopicSubscriber

FRAME_S = 0.2
PLAIN_S = 1.0
EVENTS = 200
"""Events remembered; the panel shows as many of the newest as fit."""


@dataclass(slots=True)
class Watched:
    """What is known of the daemon now.

    Args:
        status: its newest answer.      events: as they came.      units: of the states, by name.
        gone: why it does not answer, empty while it does.
    """

    status: Mapping[str, Any]
    units: Mapping[str, str]
    events: deque[Mapping[str, Any]] = field(default_factory=lambda: deque(maxlen=EVENTS))
    gone: str = ""


class Window(Protocol):
    """Where it is shown."""

    def show(self, watched: Watched, fresh: list[Mapping[str, Any]]) -> None:
        """One moment, with the events that came since the last."""

    def close(self) -> None:
        """The last one stays."""


def watch(name: str | None, connect: str, *, for_s: float | None, as_json: bool) -> None:
    """Show one daemon until Ctrl-C, or for so many seconds. Raises: ConnectionFailed, Refused."""
    first = ask(name, "status", connect)
    namespace = first["namespace"]
    layout = ask(name, "config", connect, namespace=namespace)["layout"]
    watched = Watched(first, {slot[0]: slot[1] for slot in layout["states"]})
    window = window_for(Console(), as_json)
    with TopicSubscriber(first["name"], "event", connect, namespace=namespace) as events:

        def renew() -> Mapping[str, Any]:
            answer: Mapping[str, Any] = ask(name, "status", namespace=namespace, session=events.session)
            return answer

        try:
            _follow(watched, events, renew, window, for_s)
        finally:
            window.close()


def _follow(
    watched: Watched, events: TopicSubscriber, renew: Callable[[], Mapping[str, Any]], window: Window,
    for_s: float | None,
) -> None:  # fmt: skip
    end_s = None if for_s is None else time.monotonic() + for_s
    while end_s is None or time.monotonic() < end_s:
        try:
            watched.status, watched.gone = renew(), ""
        except (ConnectionFailed, FusiondError) as error:
            watched.gone = str(error)
        fresh: list[Mapping[str, Any]] = []
        message = events.next(FRAME_S)
        while message is not None:
            fresh.append(message.content)
            message = events.next(0.0)
        watched.events += fresh
        window.show(watched, fresh)


class Panel:
    """Redraws one panel in place."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._live = Live(console=console, auto_refresh=False)
        self._live.start()

    def show(self, watched: Watched, fresh: list[Mapping[str, Any]]) -> None:
        """Draw."""
        self._live.update(panel(watched, *self._console.size), refresh=True)

    def close(self) -> None:
        """Give the cursor back."""
        self._live.stop()


class Lines:
    """Every event, and a line about once a second; as text or as JSON objects."""

    def __init__(self, as_json: bool) -> None:
        self._as_json = as_json
        self._due_s = 0.0

    def show(self, watched: Watched, fresh: list[Mapping[str, Any]]) -> None:
        """Print what is new."""
        for event in fresh:
            self._print(orjson.dumps({"event": event}).decode() if self._as_json else event_text(event))
        if time.monotonic() < self._due_s:
            return
        self._due_s = time.monotonic() + PLAIN_S
        if self._as_json:
            self._print(orjson.dumps({"status": watched.status, "gone": watched.gone}).decode())
        else:
            self._print(plain_line(watched))

    def close(self) -> None:
        """Nothing to do."""

    def _print(self, text: str) -> None:
        print(text, file=sys.stdout, flush=True)


def window_for(console: Console, as_json: bool) -> Window:
    """A panel where it can be drawn, otherwise lines."""
    terminal = console.is_terminal and not console.is_dumb_terminal and "utf" in console.encoding.lower()
    room = console.width >= WIDTH and console.height >= HEIGHT
    return Panel(console) if terminal and room and not as_json else Lines(as_json)
