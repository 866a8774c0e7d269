"""A scene on a terminal: as a panel of tables and a chart, or as one plain line."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich import box
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from fusiond.demo import chart
from fusiond.demo.scene import Scene
from fusiond.demo.verdict import Verdict

WIDTH = 100
CHART_WIDTH, CHART_HEIGHT = 78, 7
COLOURS = {
    "nominal": "green", "healthy": "green", "degraded": "yellow", "suspect": "yellow", "probation": "yellow",
    "dead_reckoning": "red", "invalid": "red", "silent": "red", "faulty": "red", "excluded": "red",
}  # fmt: skip


def panel(scene: Scene) -> RenderableType:
    """Everything at once, WIDTH columns wide."""
    setting = scene.setting
    parts: list[RenderableType] = [
        _head(scene),
        Text(),
        _states(scene),
        Text(),
        _sensors(scene),
        Text(),
        _path(scene),
    ]
    return Panel(
        Group(*parts), title=f"[bold]fusiond demo {setting.name}[/]", title_align="left", width=WIDTH,
        subtitle=f"daemon {setting.pids['daemon']} at {setting.endpoint}, plant {setting.pids['plant']}: "
        "two processes, Zenoh between them",
        subtitle_align="left", border_style="blue", padding=(0, 1),
    )  # fmt: skip


def line(scene: Scene) -> str:
    """The same in one line of plain text, for files and simple terminals."""
    parts = [f"{scene.t_s:6.2f} s"]
    if scene.estimate is not None:
        parts.append(str(scene.estimate["health"]))
        std = scene.estimate["std"]
        parts += [
            f"{name} {value:.5f} +-{3 * std[name]:.5f} {scene.setting.units.get(name, '')}"
            for name, value in scene.estimate["state"].items()
        ]
    error_m = scene.error("position")
    if error_m is not None:
        parts.append(f"error {1e3 * error_m:+.2f} mm")
    if scene.control is not None:
        parts += [f"{name} {value:+.4f} N" for name, value in scene.control["u"].items()]
    for name, sensor in _readings(scene):
        counts = f"{sensor['used']} used {_refused(sensor)} rejected"
        parts.append(f"{name} {sensor['rate_hz']:.0f}/s {counts} {sensor['health']}")
    return " | ".join(parts)


def verdict_lines(verdict: Verdict) -> RenderableType:
    """The verdict, a line for each of its parts."""
    table = Table.grid(padding=(0, 2))
    for check in verdict.checks:
        mark = {True: "[green]holds[/]", False: "[bold red]FAILS[/]", None: "[dim]not asked[/]"}[check.ok]
        table.add_row(mark, f"[bold]{check.name}[/]", check.text)
    outcome = "[bold green]verdict: everything holds[/]" if verdict.ok else "[bold red]verdict: FAILED[/]"
    return Group(table, Text.from_markup(outcome))


def _head(scene: Scene) -> RenderableType:
    health = "waiting" if scene.estimate is None else str(scene.estimate["health"])
    head = Table.grid(expand=True)
    head.add_column()
    head.add_column(justify="right")
    text = Text.assemble("service ", (f" {health} ", f"bold reverse {COLOURS.get(health, 'white')}"))
    if scene.control is not None:
        for name, value in scene.control["u"].items():
            text.append(f"   {name} {value:+8.4f} N")
        if not scene.control["valid"]:
            text.append(" (not valid)", "red")
    head.add_row(text, f"{scene.t_s:5.1f} of {scene.setting.duration_s:g} s")
    return head


def _states(scene: Scene) -> RenderableType:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False, show_edge=False)
    table.add_column("state", width=23)
    for name, width in (("estimate", 10), ("3 sigma", 10), ("truth", 10), ("error", 10)):
        table.add_column(name, justify="right", width=width)
    table.add_column("error in 3 sigma", width=17)
    estimate: Mapping[str, Any] = scene.estimate or {"state": {}, "std": {}}
    for name, unit in scene.setting.units.items():
        value, std, error = estimate["state"].get(name), estimate["std"].get(name), scene.error(name)
        label = Text.assemble(name.replace("_", " "), (f" {unit.replace('_', '/')}", "dim"))
        if value is None or std is None:
            table.add_row(label, "-", "-", "-", "-", "")
            continue
        bar = Text()
        if error is not None:
            bar = Text(chart.deviation(error, 3 * std), "green" if abs(error) <= 3 * std else "red")
        truth = "-" if error is None else f"{value - error:.5f}"
        shown = "-" if error is None else f"{error:+.5f}"
        table.add_row(label, Text(f"{value:.5f}", "bold"), f"±{3 * std:.5f}", truth, shown, bar)
    return table


def _sensors(scene: Scene) -> RenderableType:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False, show_edge=False)
    table.add_column("sensor", width=23)
    for name in ("rate", "used", "rejected", "lost"):
        table.add_column(name, justify="right", width=10)
    table.add_column("health", width=17)
    for name, sensor in _readings(scene):
        health = str(sensor["health"])
        table.add_row(
            name, f"{sensor['rate_hz']:.0f} /s", f"{sensor['used']}", f"{_refused(sensor)}", f"{sensor['lost']}",
            Text(health, COLOURS.get(health, "white")),
        )  # fmt: skip
    return table


def _path(scene: Scene) -> RenderableType:
    """Position over time towards the goal."""
    goal_m = scene.setting.goal_m
    values = [goal_m, *(p for _, truth, estimate in scene.path for p in (truth, estimate))]
    low, high = min(values), max(values)
    margin = 0.08 * max(high - low, 0.05)
    y_range = (low - margin, high + margin)
    points = [(t_s, estimate) for t_s, _, estimate in scene.path]
    lines = chart.curve(points, scene.setting.duration_s, y_range, CHART_WIDTH, CHART_HEIGHT)
    goal_row = chart.rule(goal_m, y_range, CHART_HEIGHT)
    grid = Table.grid(padding=(0, 1))
    for row, dots in enumerate(lines):
        label = Text("")
        if row == goal_row:
            label = Text(f"goal {goal_m:g} m", "yellow")
        elif row == 0 or row == CHART_HEIGHT - 1:
            label = Text(f"{y_range[row == 0]:.2f} m", "dim")
        drawn = Text()
        for cell in dots:
            drawn.append(
                *((cell, "cyan") if cell != " " else ("┄" if row == goal_row else " ", "yellow dim"))
            )
        grid.add_row(Text(label.plain.rjust(12), label.style), drawn)
    return Group(Text("position over time", "dim"), grid)


def _readings(scene: Scene) -> list[tuple[str, Mapping[str, Any]]]:
    """The sensors that sent anything, or should have."""
    if scene.status is None:
        return []
    return [(name, s) for name, s in scene.status["sensors"].items() if name != "reference" or s["used"]]


def _refused(sensor: Mapping[str, Any]) -> int:
    """Readings that were not used, and what was no reading."""
    return int(sensor["rejected"] + sensor["late"] + sum(sensor["refused"].values()))
