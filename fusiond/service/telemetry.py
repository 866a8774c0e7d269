"""What the daemon says: lines on stderr, for people on a terminal, JSON elsewhere.

Every line is `subject: fact, limit, remedy` with the same facts as fields. What repeats is said at most every ten
seconds per subject, with the number left out in between.
"""

from __future__ import annotations

import sys
from typing import Any

import structlog

QUIET_NS = 10_000_000_000
"""Shortest time between two lines of one subject and kind."""


def set_up(*, as_json: bool | None = None) -> None:
    """Send structlog to stderr; as JSON unless stderr is a terminal, or as told."""
    as_json = not sys.stderr.isatty() if as_json is None else as_json
    renderer: Any = structlog.processors.JSONRenderer() if as_json else structlog.dev.ConsoleRenderer()
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            renderer,
        ],
        logger_factory=structlog.PrintLoggerFactory(sys.stderr),
        cache_logger_on_first_use=True,
    )


class Voice:
    """The log, with what repeats held back.

    Args:
        logger: has `info`, `warning` and `error`, as structlog's.
    """

    def __init__(self, logger: Any) -> None:
        self._logger = logger
        self._said: dict[str, tuple[int, int]] = {}

    def info(self, text: str, **facts: Any) -> None:
        """Say what is as it should be."""
        self._logger.info(text, **facts)

    def warn(self, kind: str, now_ns: int, text: str, **facts: Any) -> bool:
        """Say what is not, unless its kind was just said; returns whether it was said."""
        said_ns, held_back = self._said.get(kind, (now_ns - QUIET_NS, 0))
        if now_ns - said_ns < QUIET_NS:
            self._said[kind] = (said_ns, held_back + 1)
            return False
        self._said[kind] = (now_ns, 0)
        if held_back:
            facts["held_back"] = held_back
        self._logger.warning(text, **facts)
        return True

    def error(self, text: str, **facts: Any) -> None:
        """Say what ends the daemon or a part of it."""
        self._logger.error(text, **facts)
