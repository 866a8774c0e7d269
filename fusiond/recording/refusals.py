"""What never became a reading: counted by reason, the first of each kind remembered."""

from __future__ import annotations

from dataclasses import dataclass, field

from fusiond.types import Verdict


@dataclass(slots=True)
class Refusals:
    """Counts of what a decoder refused.

    Args:
        counts: how many, by reason.
        first: where the first of each reason stood and what it was, for people.
        notes: what else is wrong with the whole source (cut short, readings lost while it was recorded).
    """

    counts: dict[Verdict, int] = field(default_factory=dict)
    first: dict[Verdict, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def clear(self) -> None:
        """Forget everything: the source is read anew."""
        self.counts.clear()
        self.first.clear()
        self.notes.clear()

    def add(self, verdict: Verdict, where: str, number: int = 1) -> None:
        """Count `number` refusals; `where` is kept if it is the first of its kind."""
        self.counts[verdict] = self.counts.get(verdict, 0) + number
        self.first.setdefault(verdict, where)

    def by_name(self) -> dict[str, int]:
        """Counts by the word an operator reads."""
        return {verdict.label: count for verdict, count in sorted(self.counts.items())}

    def messages(self) -> list[str]:
        """The notes, then one line for each reason: how many, and the first."""
        return self.notes + [
            f"{count} refused as {verdict.label}, the first: {self.first[verdict]}"
            for verdict, count in sorted(self.counts.items())
        ]
