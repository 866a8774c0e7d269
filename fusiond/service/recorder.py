"""What the daemon needs of whoever records it."""

from __future__ import annotations

from typing import Any, Protocol

from numpy.typing import NDArray


class Recorder(Protocol):
    """Where the daemon writes what it decided; never makes it wait (`recording.background.BackgroundWriter`)."""

    dropped: dict[str, int]
    error: str

    def put_readings(self, block: NDArray[Any]) -> bool:
        """Readings and ticks, in the order processed."""

    def put_reports(self, block: NDArray[Any]) -> bool:
        """Their reports."""

    def put_message(self, topic: str, payload: bytes, t_ns: int, log_time_ns: int) -> bool:
        """A JSON message that went out."""
