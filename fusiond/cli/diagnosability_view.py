"""The diagnosability matrix of `fusiond check`, for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console

from fusiond.cli.views import number, table_of

SELF_EVIDENT = ("stuck", "silent", "garbage", "spike")
"""Kinds that show themselves by what comes or does not come, whatever the model."""


def show_diagnosability(result: Mapping[str, Any], console: Console) -> None:
    """What can be found, how small, how soon, and whom it cannot be told from."""
    rows = [row for row in result["diagnosability"] if row["kind"] not in SELF_EVIDENT]
    if not rows:
        return
    promise = result["thresholds"].get("mean_time_between_false_alarms_s")
    title = (
        f"faults, at one false alarm in {promise:g} s"
        if promise
        else "faults that a section [faults] would find"
    )
    table = table_of(title, "sensor", "channel", "kind", "smallest", "found after", "not told from", "remark")
    for row in rows:
        table.add_row(
            row["sensor"],
            row["channel"],
            row["kind"],
            number(row["smallest"]),
            "never" if row["delay_s"] is None else f"{row['delay_s']:.3g} s",
            ", ".join(row["ambiguous_with"]) or "-",
            _remark(row),
        )
    console.print(table)


def _remark(row: Mapping[str, Any]) -> str:
    """Why, and what would help."""
    cures = [f"{cure['state']} (std {cure['noise_std']:.2g})" for cure in row["cured_by"]]
    helped = f"a sensor of {' or '.join(cures)} would cure it" if cures else ""
    return "; ".join(part for part in (row["reason"], helped) if part)
