"""`fusiond why SENSOR`: the decisions about a sensor's readings as a table; and what a replay found wrong, in lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import Console
from rich.table import Table

from fusiond.recording.fault_words import fault_text

DELAY, RELATIVE = "delay ms", "delay - least ms"
COLUMNS = ("stamp s", DELAY, "z", "nu", "S", "R used", "R declared", "nis", "limit", "verdict", "health")
OTHER_CLOCK_S = 3600.0
"""A delay of an hour is none: the stamps are of another clock than the arrivals, and only differences mean anything."""
NARROW, SPARED = 120, (DELAY, RELATIVE, "S", "R used", "R declared", "fault")
"""On a terminal with fewer columns these are left out of the table; a file has them all."""
WIDTH = 160
"""Of the table where no terminal says otherwise: a file has all of it."""


def show_why(answer: Mapping[str, Any], console: Console | None = None) -> None:
    """Turns of the sensor's health, then one row for each reading."""
    console = console or screen()
    covers = answer["covers_s"]
    if covers is None:
        console.print(f"{answer['sensor']}: no reading has come yet", highlight=False)
        return
    kept = f"{answer['sensor']} ({answer['role']}): kept from {covers[0]:.3f} to {covers[1]:.3f} s"
    console.print(kept, highlight=False)
    at_s = answer["at_s"]
    if at_s is not None and not covers[0] <= at_s <= covers[1]:
        console.print(
            f"{at_s:.3f} s is outside of that; below are the readings nearest to it", highlight=False
        )
    for turn in answer["turns"]:
        console.print(
            f"  {turn['t_s']:.3f} s  {turn['to']}{_fault(turn['fault'])}", markup=False, highlight=False
        )
    narrow = console.width < NARROW
    console.print(_table(answer["readings"], SPARED if narrow else ()))
    if narrow:
        console.print(f"delay, S, R and fault need {NARROW} columns, or a file", style="dim", highlight=False)


def found_lines(result: Mapping[str, Any]) -> list[str]:
    """What a replay found wrong, a line for each fault and each alarm of the model, with when it was found and over."""
    said = [
        f"  {name}: {fault_text(dict(fault))}{_until(fault)}"
        for name, sensor in result["sensors"].items()
        for fault in sensor["faults"]
    ]
    alarms = result["model"]["alarms"]
    return said + [f"  model: does not describe what is measured{_until(alarm)}" for alarm in alarms]


def _until(found: Mapping[str, Any]) -> str:
    over = "to the end" if found["cleared_s"] is None else f"over at {found['cleared_s']:.3f} s"
    return f", found at {found['detected_s']:.3f} s, {over}"


def screen() -> Console:
    """Standard output: lines of text are never broken, tables keep to a terminal's width and are whole in a file."""
    console = Console(soft_wrap=True)
    return console if console.is_terminal else Console(soft_wrap=True, width=WIDTH)


def _table(readings: Sequence[Mapping[str, Any]], spared: Sequence[str]) -> Table:
    """One row for each reading, without the columns spared; faults and actions only where there are any."""
    faults = any(reading["fault"] for reading in readings)
    actions = any(reading["action"] != "none" for reading in readings)
    least_s = min((r["delay_s"] for r in readings if r["delay_s"] is not None), default=0.0)
    same_clock = abs(least_s) < OTHER_CLOCK_S
    names = [*(COLUMNS if same_clock else (COLUMNS[0], RELATIVE, *COLUMNS[2:]))]
    names += [name for name, wanted in (("fault", faults), ("action", actions)) if wanted]
    kept = [place for place, name in enumerate(names) if name not in spared]
    table = Table(box=None, pad_edge=False)
    for name in (names[place] for place in kept):
        words = name in ("verdict", "health", "fault", "action")
        table.add_column(name, justify="left" if words else "right", no_wrap=name not in ("fault", "action"))
    for reading in readings:
        cells = _cells(reading, 0.0 if same_clock else least_s)
        cells += [fault_text(reading["fault"]) if reading["fault"] else ""] if faults else []
        cells += [reading["action"] if reading["action"] != "none" else ""] if actions else []
        table.add_row(*(cells[place] for place in kept))
    return table


def _cells(reading: Mapping[str, Any], from_s: float) -> list[str]:
    """What stands in COLUMNS; delays are counted from `from_s` on."""
    delay_s = reading["delay_s"]
    return [
        f"{reading['t_s']:.3f}",
        "-" if delay_s is None else f"{1e3 * (delay_s - from_s):.1f}",
        *(numbers(reading[name]) for name in ("z", "nu", "S", "R_used", "R_declared")),
        number(reading["nis"]),
        number(reading["limit"]),
        str(reading["verdict"]),
        str(reading["health"]),
    ]


def number(value: float | None) -> str:
    """Four digits, or a dash."""
    return "-" if value is None else f"{value:.4g}"


def numbers(values: Sequence[float | None]) -> str:
    """A vector in one cell, or a dash where it has none."""
    return " ".join(number(value) for value in values) or "-"


def _fault(fault: Mapping[str, Any] | None) -> str:
    return "" if fault is None else f": {fault_text(dict(fault))}"
