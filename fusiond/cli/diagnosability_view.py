"""The diagnosability matrix of `fusiond check`, for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console

from fusiond.cli.views import table_of

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
        else r"faults that a section \[faults] would find"
    )
    table = table_of(title, "sensor", "channel", "kind", "smallest", "found after", "not told from", "note")
    notes: dict[str, int] = {}
    for row in rows:
        remark = _remark(row)
        note = notes.setdefault(remark, len(notes) + 1) if remark else None
        table.add_row(
            row["sensor"],
            row["channel"],
            row["kind"],
            _size(row),
            "never" if row["delay_s"] is None else f"{row['delay_s']:.3g} s",
            ", ".join(row["ambiguous_with"]) or "-",
            f"({note})" if note else "",
        )
    console.print(table)
    for remark, note in notes.items():
        console.print(f"({note}) {remark}", highlight=False)


def _size(row: Mapping[str, Any]) -> str:
    """The smallest fault found: in the channel's unit, or as its kind is measured."""
    size, kind = row["smallest"], row["kind"]
    if size is None:
        return "-"
    if kind == "scale":
        return f"{100.0 * size:.3g} %"
    return f"{size:.3g}" + {"drift": " /s", "noise": " x", "delay": " s"}.get(kind, "")


def _remark(row: Mapping[str, Any]) -> str:
    """Why, and what would help."""
    cures = [f"{cure['state']} (std {cure['noise_std']:.2g})" for cure in row["cured_by"]]
    helped = f"a sensor of {' or '.join(cures)} would cure it" if cures else ""
    return "; ".join(part for part in (row["reason"], helped) if part)
