"""The command drives nothing: the hooks of a configuration whose prediction does not depend on it."""

from __future__ import annotations

from typing import Any

from fusiond.numerics.kernel import kernel


@kernel
def note_applied(desk: Any, design: Any, reading: Any) -> None:
    """A reading drives the prediction."""


@kernel
def write_acting(desk: Any, design: Any, now_ns: int, reading: Any) -> bool:
    """Whether the prediction must be told of a command; `reading` then tells it."""
    return False


@kernel
def stand_in(track: Any, design: Any, work: Any, reading: Any) -> None:
    """A command has been given: it stands in for an input that is out."""
