"""One figure of the page of the seeds: what is expected, how it is measured, whether it holds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Row:
    """One figure.

    expected: as it stands on the page, with where it comes from.   measure: runs what the figure is about.
    form: how it is written.   holds: whether it is as expected.   cheap: whether `--check` measures it again.
    """

    what: str
    expected: str
    measure: Callable[[], float]
    form: str
    holds: Callable[[float], bool]
    cheap: bool = True

    def written(self) -> str:
        """The row as a line of a table."""
        value = self.measure()
        verdict = "yes" if self.holds(value) else "**no**"
        return f"| {self.what} | {self.expected} | {self.form.format(value)} | {verdict} |"


def near(expected: float, relative: float) -> Callable[[float], bool]:
    """Holds within a relative distance."""
    return lambda value: abs(value - expected) <= relative * abs(expected)


def within(expected: float, distance: float) -> Callable[[float], bool]:
    """Holds within a distance."""
    return lambda value: abs(value - expected) <= distance


def between(low: float, high: float) -> Callable[[float], bool]:
    """Holds from low to high."""
    return lambda value: low <= value <= high
