"""What every part of the scoreboard hands in: rows, and curves for the pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from tools.bench_page import Row

__all__ = ["Effort", "Part", "Result", "Row"]


@dataclass(frozen=True, slots=True)
class Effort:
    """How much is spent: shares of the full numbers of runs."""

    share: float

    def runs(self, full: int, least: int = 8) -> int:
        """So many runs instead of `full`."""
        return max(least, round(full * self.share))


FULL, QUICK = Effort(1.0), Effort(0.02)


@dataclass(slots=True)
class Result:
    """One part's rows, and its curves by name: columns of equal length."""

    rows: list[Row] = field(default_factory=list)
    curves: dict[str, dict[str, Sequence[Any]]] = field(default_factory=dict)


Part = Callable[[Effort], Result]
