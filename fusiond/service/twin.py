"""Whether a standby is in step: its own estimates and commands beside what the active daemon says of the same time."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

KEPT = 1024
"""Messages of its own that a standby remembers of each topic."""
CLOSE = 1e-3
"""Part of a standard deviation, or of a command, within which two daemons are in step."""


@dataclass(frozen=True, slots=True)
class Said:
    """What one daemon says of one moment.

    Args:
        values: state, or command.   scale: what a difference is measured by, standard deviations or the command.
    """

    t_ns: int
    seq: int
    values: tuple[float, ...]
    scale: tuple[float, ...]
    resets: int = 0


def estimate_said(content: Mapping[str, Any]) -> Said:
    """Of an estimate as it goes out, JSON or record."""
    values, scale = _numbers(content["state"]), _numbers(content["std"])
    return Said(int(content["t_ns"]), int(content["seq"]), values, scale, int(content["resets"]))


def command_said(content: Mapping[str, Any]) -> Said:
    """Of a command as it goes out, JSON or record."""
    values = _numbers(content["u"])
    return Said(int(content["t_ns"]), int(content["seq"]), values, values)


SAID: dict[str, Callable[[Mapping[str, Any]], Said]] = {"estimate": estimate_said, "control": command_said}


def said_in(topic: str, content: Mapping[str, Any]) -> Said | None:
    """What a message from outside says, None where it is none of its topic."""
    try:
        return SAID[topic](content)
    except (KeyError, TypeError, ValueError, OverflowError):
        return None


def _numbers(part: Mapping[str, float] | Sequence[float]) -> tuple[float, ...]:
    return tuple(float(one) for one in (part.values() if isinstance(part, Mapping) else part))


def close(own: Said, other: Said) -> bool:
    """Whether two daemons say the same, but for what makes no difference."""
    if own.resets != other.resets or len(own.values) != len(other.values):
        return False
    # A manifold has fewer deviations than numbers: those without one are compared to 1.
    scale = other.scale if len(other.scale) == len(other.values) else (1.0,) * len(other.values)
    return all(abs(a - b) <= CLOSE * abs(s) for a, b, s in zip(own.values, other.values, scale, strict=True))


class Twin:
    """A standby's own messages, by time."""

    def __init__(self) -> None:
        self._own: OrderedDict[int, Said] = OrderedDict()

    def note(self, said: Said) -> None:
        """Remember a message of its own."""
        self._own[said.t_ns] = said
        self._own.move_to_end(said.t_ns)
        while len(self._own) > KEPT:
            self._own.popitem(last=False)

    def shift(self, by: int) -> None:
        """Number them as the other daemon does."""
        if by:
            self._own = OrderedDict((t, replace(one, seq=one.seq + by)) for t, one in self._own.items())

    def clear(self) -> None:
        """Forget all: what was said before is no longer what would be."""
        self._own.clear()

    def beside(self, other: Said) -> Said | None:
        """Its own message of the same moment; None where it has none."""
        return self._own.get(other.t_ns)
