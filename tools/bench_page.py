"""docs/benchmarks.md from what was measured: one line a row, with its identity and the day."""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

DAEMON = (
    " The daemon's rates and round trip are those of the mini car without `[faults]`: "
    "a paced stream of one sensor is no car's. A command's age is that of a car in its loop, with `[faults]`."
)
"""How the daemon is configured that is measured."""
REMARKS = {
    "2.daemon.rtt.p50": "Missed by the median round trip: repeated runs give 1.5 to 1.7 times a bare echo. Tried: no "
    "hand-over between threads, numba's dispatcher bypassed, health and counters after the put, one session for "
    "readings and estimates. Where the rest of the distance to the echo goes is not explained.",
}
"""What is known of a promise that is not kept."""


MISSED = "**no**"
COLUMNS = "| row | what | measured | against | ratio | reach | | day |\n|---|---|---|---|---|---|---|---|"
LINE = re.compile(r"^\| `([\w.]+)` \|.*$", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Row:
    """One promise: what was measured, against whom, and what was to be reached.

    Args:
        ratio: value over the peer's, None without a peer.   reach: the promise.   ok: whether it is kept.
    """

    id: str
    name: str
    value: float
    unit: str
    against: str
    ratio: float | None
    reach: str
    ok: bool


def cells(row: Row) -> str:
    """What a table says of a row."""
    ratio = "" if row.ratio is None else f"{row.ratio:.3g}"
    kept = "yes" if row.ok else MISSED
    return f"{row.name} | {row.value:,.4g} {row.unit} | {row.against} | {ratio} | {row.reach} | {kept}"


def table(rows: Sequence[Row]) -> str:
    """The rows as Markdown."""
    lines = ["| what | measured | against | ratio | reach | |", "|---|---|---|---|---|---|"]
    return "\n".join([*lines, *(f"| {cells(row)} |" for row in rows)])


def machine() -> str:
    """The machine in one line."""
    model = platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        names = [
            line.split(":", 1)[1].strip() for line in cpuinfo.read_text().splitlines() if "model name" in line
        ]
        model = names[0] if names else model
    return f"{os.cpu_count()} cores, {model}, {platform.system()}, Python {platform.python_version()}"


def lines_of(page: str) -> dict[str, str]:
    """The lines of a page's table, by identity."""
    return {match[1]: match[0] for match in LINE.finditer(page)}


def page_of(rows: Sequence[Row], earlier: str = "") -> str:
    """The page: rows in the place of their earlier lines, new ones at the end; the other lines stay.

    Args:
        earlier: the page before, where a part was measured; empty: all was.
    Raises: ValueError where the page before is of another machine.
    """
    if earlier and f": {machine()}." not in earlier:
        raise ValueError(f"the page is of another machine than this ({machine()}); measure everything")
    day = datetime.now(UTC).date()
    lines = lines_of(earlier) | {row.id: f"| `{row.id}` | {cells(row)} | {day} |" for row in rows}
    head = f"# Benchmarks\n\nMeasured by `make bench`: {machine()}.{DAEMON}\n\n{COLUMNS}"
    return "\n".join([head, *lines.values(), remarks(lines)])


def remarks(lines: Mapping[str, str]) -> str:
    """A paragraph for every missed promise of which something is known."""
    missed = (text for name, text in REMARKS.items() if MISSED in lines.get(name, ""))
    return "".join(f"\n{text}\n" for text in missed)
