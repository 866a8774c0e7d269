"""A running daemon on a terminal: as a panel of tables, or as plain lines."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from fusiond.demo.view import COLOURS
from fusiond.recording.fault_words import fault_text

if TYPE_CHECKING:
    from fusiond.cli.watching import Watched

WIDTH, HEIGHT = 80, 20
"""Of the smallest terminal on which the panel is drawn."""
FRAME = 11
"""Lines of the panel that are neither states nor sensors nor events."""


def panel(watched: Watched, columns: int, lines: int) -> RenderableType:
    """Everything at once, on a terminal of so many columns and lines."""
    status = watched.status
    sensors = status["sensors"]
    states = list(watched.units)
    room = lines - 1 - FRAME - len(sensors)
    shown = states[: max(1, room - 3)]
    events = list(watched.events)[-max(1, room - len(shown)) :]
    parts = [
        _head(watched), Text(), _states(watched, shown), Text(), _sensors(sensors), Text(), _events(events),
    ]  # fmt: skip
    title = f"[bold]fusiond watch {status['name']}[/]"
    places = f"{status['namespace']}, daemon {status['pid']}, up {status['uptime_s']:.0f} s"
    return Panel(
        Group(*parts), title=title, title_align="left", width=min(columns, 120), subtitle=places,
        subtitle_align="left", border_style="blue", padding=(0, 1),
    )  # fmt: skip


def plain_line(watched: Watched) -> str:
    """The same in one line of plain text."""
    if watched.gone:
        return f"no answer: {watched.gone}"
    status = watched.status
    estimate = status["estimate"] or {"t": 0.0, "state": {}, "std": {}}
    parts = [f"{estimate['t']:.2f} s", str(status["service"])]
    parts += ["MODEL ALARM"] if status["model"]["alarm"] else []
    parts += ["+- 3 sigma"] if estimate["state"] else []
    for name, value in estimate["state"].items():
        std = estimate["std"].get(name)
        band = "" if std is None else f" +-{3 * std:.4g}"
        parts.append(f"{name} {value:.5g}{band} {watched.units.get(name, '').replace('_', '/')}".rstrip())
    parts += [f"{name} {condition(sensor)}" for name, sensor in status["sensors"].items()]
    return " | ".join(parts)


def condition(sensor: Mapping[str, Any]) -> str:
    """`healthy`, or `excluded: bias +0.5 +-0.01 m since 10.0 s`."""
    health, fault = str(sensor["health"]), sensor["fault"]
    if not fault:
        return health
    return fault_text(fault) if fault["kind"] == health else f"{health}: {fault_text(fault)}"


def event_text(event: Mapping[str, Any]) -> str:
    """One event, as a person says it."""
    subject = event["sensor"] or "service"
    text = f"{event['t']:.3f} s  {subject}: {event['from']} -> {event['to']}"
    if event["from"] == event["to"]:
        text = f"{event['t']:.3f} s  {subject}: {event['to']}"
    if event["fault"]:
        text += f"; {fault_text(event['fault'])}"
    if event.get("model"):
        text += "; the model does not describe what is measured"
    if event.get("takeover"):
        text += f"; the daemon of rank {event['takeover']['rank']} speaks from now on"
        text += "; the estimate jumps" if event.get("reset") else ""
    elif event.get("reset"):
        text += f"; state set to its initial value, {event['reset']['resets']} resets so far"
    return text


def _head(watched: Watched) -> RenderableType:
    status = watched.status
    service = str(status["service"])
    head = Table.grid(expand=True)
    head.add_column()
    head.add_column(justify="right")
    text = Text.assemble("service ", (f" {service} ", f"bold reverse {COLOURS.get(service, 'white')}"))
    if status["model"]["alarm"]:
        text.append("   model alarm", "bold red")
    if watched.gone:
        text = Text(f"no answer: {watched.gone}", "bold red", no_wrap=True, overflow="ellipsis")
    estimate = status["estimate"]
    head.add_row(text, "" if estimate is None else f"{estimate['t']:.2f} s")
    return head


def _states(watched: Watched, shown: Iterable[str]) -> RenderableType:
    table = _table("state", "estimate", "3 sigma", "unit")
    estimate = watched.status["estimate"] or {"state": {}, "std": {}}
    for name in shown:
        value, std = estimate["state"].get(name), estimate["std"].get(name)
        cells = ["-" if value is None else f"{value:.6g}", "-" if std is None else f"±{3 * std:.4g}"]
        table.add_row(name.replace("_", " "), *cells, watched.units[name].replace("_", "/"))
    return table


def _sensors(sensors: Mapping[str, Mapping[str, Any]]) -> RenderableType:
    table = _table("sensor", "rate", "used", "rejected", "lost", "health")
    # what is narrow keeps its width: the fault beside it is what may be cut
    for column, width in zip(table.columns, (max(map(len, sensors), default=0), 7, 6, 8, 4), strict=False):
        column.min_width = width
    for name, sensor in sensors.items():
        rejected = sensor["rejected"] + sensor["late"] + sum(sensor["refused"].values())
        health = Text(condition(sensor), COLOURS.get(str(sensor["health"]), "white"), overflow="ellipsis")
        counts = (f"{sensor['rate_hz']:.0f} /s", str(sensor["used"]), str(rejected), str(sensor["lost"]))
        table.add_row(name, *counts, health)
    return table


def _events(events: list[Mapping[str, Any]]) -> RenderableType:
    lines = [Text(event_text(event), no_wrap=True, overflow="ellipsis") for event in events]
    return Group(Text("events", "dim"), *(lines or [Text("none since watching began", "dim")]))


def _table(*columns: str) -> Table:
    """First and last column left, the numbers between them right."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False, show_edge=False)
    for k, name in enumerate(columns):
        table.add_column(name, justify="left" if k in (0, len(columns) - 1) else "right", no_wrap=True)
    return table
