"""docs/scoreboard.md from what was measured."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from tools.bench_page import machine, table
from tools.scoreboard.board import Result, Row
from tools.scoreboard.pictures import draw

TEXT = """# Scoreboard

How fast and how surely faults are found, over the limit. Measured by `make scoreboard` on {day}: {machine}{quick}.

Every row runs a configuration through the engine's step; every threshold comes from the configuration alone; no seed
used here was used to derive anything. 1.00 is the limit where a row has a ratio. A missed number stays in the table.

- **Onset.** White residuals: the fault begins with the statistics at zero, for the exact CUSUM likewise. Elsewhere:
  {before} healthy readings go before it, for the oracle likewise, and only alarms from the onset on count.
- **The same false alarms.** The bound and the oracle get the interval between false alarms that was *measured* on
  the engine, not the promised one. "One sensor's bank" counts the alarms of its cells; "whole service" those of every
  test: frozen values, variance, whiteness, pooled variance.
- **Oracle.** A CUSUM on the innovations of the plain settled filter that knows the fault's profile and size and lacks
  only its onset.
- **False alarms in the table** are told apart by test. An interval promised for longer than was simulated here is an
  extrapolation: the thresholds grow by the logarithm of the interval.

## Delay
![Delay against size](pictures/scoreboard_delay.svg)

{delay}

## False alarms
![Measured against promised interval](pictures/scoreboard_promise.svg)

{promise}

## Who, how much, since when
![Confusion](pictures/scoreboard_confusion.svg)

Predicted by the diagnosability matrix of `fusiond check`: with three sensors on constant velocity and with two on the
stable reference plant every sensor can be told from every other; two equal sensors on constant velocity cannot, so the
set of both is the only right answer.

{naming}

## Noise that is not as declared

What the methods are, and what the figures mean: [adaptation.md](adaptation.md).

{adaptation}

## Control

What the laws do, and when the command is a safe one: [control.md](control.md).

{control}

## What is left afterwards

{after}

## Recordings

Recordings that nobody in this project made ([recordings.md](recordings.md)), with their configurations as they are in
`configs/`; one without a section `[faults]` is given one that says nothing, so with the defaults. They are run whole;
`tests/recordings` runs them with the robust profile. The lines of the catalogue are those of
[catalogue.md](catalogue.md).

{recordings}
"""


ADAPTATION, CONTROL = "5.adapt.", "5.control."
"""Beginnings of the identities of rows that have a section of their own."""


def under(rows: list[Row], *prefixes: str) -> str:
    """The rows whose identity begins with one of these numbers, as a table; those with a section apart."""
    ours = [row for row in rows if not row.id.startswith((ADAPTATION, CONTROL))]
    return table([row for row in ours if row.id.split(".")[0] in prefixes])


def of(rows: list[Row], beginning: str) -> str:
    """The rows whose identity begins so, as a table."""
    return table([row for row in rows if row.id.startswith(beginning)])


def write(path: Path, result: Result, quick: bool = False) -> None:
    """Write the page, and its pictures beside it."""
    from tools.scoreboard.delays import BEFORE

    draw(path.parent / "pictures", result.curves)
    text = TEXT.format(
        day=datetime.now(UTC).date(), machine=machine(), quick=", few runs only" if quick else "", before=BEFORE,
        delay=under(result.rows, "2", "3", "4", "5"), promise=under(result.rows, "1"),
        naming=under(result.rows, "6"), after=under(result.rows, "7", "8", "9"),
        recordings=under(result.rows, "10"),
        adaptation=of(result.rows, ADAPTATION), control=of(result.rows, CONTROL),
    )  # fmt: skip
    path.write_text(text, encoding="utf-8")
