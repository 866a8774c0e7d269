"""The control loop in `fusiond check`, for people."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from rich.console import Console

from fusiond.cli.views import number, table_of


def show_loop(result: Mapping[str, Any], console: Console) -> None:
    """Poles, margins and expected costs; nothing without a designed law."""
    margins = result["margins"]
    if not margins:
        return
    late = f", {margins['delay_periods']} late" if margins["delay_periods"] else ""
    title = f"control: {margins['law']}, a command every {margins['period_s']:g} s{late}"
    table = table_of(title, "loop", "slowest pole", "disk margin", "gain", "phase")
    for name, words in (("regulator", "told the state"), ("with_estimate", "with the filter")):
        loop = margins[name]
        if loop is not None:
            least, most = loop["gain_margin"]
            slowest = max(math.hypot(*pole) for pole in loop["poles"])
            gain = f"{least:.3g} to {'any' if most is None else f'{most:.3g}'}"
            phase = f"{math.degrees(loop['phase_margin_rad']):.3g} deg"
            table.add_row(words, f"|{slowest:.4g}|", f"{loop['disk_margin']:.3g}", gain, phase)
    console.print(table)
    if margins["expected_cost"]:
        table = table_of("expected cost a second", "working sensors", "cost")
        for row in margins["expected_cost"]:
            table.add_row(
                ", ".join(row["working"]) or "none",
                "no limit" if row["cost"] is None else number(row["cost"]),
            )
        console.print(table)
