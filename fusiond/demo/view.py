"""A scene on a terminal: as a panel of tables and a chart, or as one plain line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich import box
from rich.console import Group, RenderableType
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from fusiond.demo import chart
from fusiond.demo.scene import Scene
from fusiond.demo.verdict import Verdict
from fusiond.recording.fault_words import fault_text

WIDTH, HEIGHT = 100, 24
"""Of the whole panel, where the terminal has room for it."""
LEAST_WIDTH, LEAST_HEIGHT = 80, 22
"""Of a terminal on which the panel can be drawn at all: without the column of the truth, and with a lower chart."""
LABEL = 23
LEAST_CHART = 5
"""Lines of the chart, where there are more states than room."""
COLOURS = {
    "nominal": "green", "healthy": "green", "degraded": "yellow", "suspect": "yellow", "probation": "yellow",
    "dead_reckoning": "red", "invalid": "red", "silent": "red", "faulty": "red", "excluded": "red",
}  # fmt: skip


def panel(scene: Scene, columns: int = WIDTH, lines: int = HEIGHT) -> RenderableType:
    """Everything at once, on a terminal of so many columns and lines (at least LEAST_WIDTH and LEAST_HEIGHT)."""
    setting = scene.setting
    wide = columns >= WIDTH
    width = WIDTH if wide else LEAST_WIDTH
    room = min(HEIGHT + max(0, len(setting.units) - 3), lines - 1) - 2 * bool(setting.faults)
    # 14 lines are neither the chart's nor the states'
    shown = _shown(scene, room - 14 - LEAST_CHART)
    path = (_plan if scene.plan else _path)(scene, width - 19, room - 14 - len(shown))
    parts: list[RenderableType] = [
        _head(scene),
        *([_injected(scene), _found(scene)] if setting.faults else []),
        Text(),
        _states(scene, wide, shown),
        Text(),
        _sensors(scene, wide),
        Text(),
        path,
    ]
    places = f"daemon {setting.pids['daemon']} at {setting.endpoint}, plant {setting.pids['plant']}"
    return Panel(
        Group(*parts), title=f"[bold]fusiond demo {setting.name}[/]", title_align="left", width=width,
        subtitle=places + (": two processes, Zenoh between them" if wide else ""),
        subtitle_align="left", border_style="blue", padding=(0, 1),
    )  # fmt: skip


def line(scene: Scene) -> str:
    """The same in one line of plain text, for files and simple terminals."""
    parts = [f"{scene.t_s:6.2f} s"]
    if scene.estimate is not None:
        parts.append(str(scene.estimate["health"]))
        std = scene.estimate["std"]
        parts.append("+- 3 sigma")
        parts += [
            f"{name} {value:.5f} +-{3 * std[name]:.5f} {scene.setting.units.get(name, '').replace('_', '/')}"
            for name, value in scene.estimate["state"].items()
            if name in std
        ]
    for name in scene.setting.watched:
        error = scene.error(name)
        if error is not None and scene.setting.units.get(name) == "m":
            parts.append(f"error {1e3 * error:+.2f} mm")
    if scene.control is not None:
        parts += [f"{name} {value:+.4f} N" for name, value in scene.control["u"].items()]
    for name, sensor in _readings(scene):
        counts = f"{sensor['used']} used {_refused(sensor)} rejected"
        fault = f" ({fault_text(sensor['fault'])})" if sensor.get("fault") else ""
        parts.append(f"{name} {sensor['rate_hz']:.0f}/s {counts} {sensor['health']}{fault}")
    parts += [f"INJECTING {fault}" for fault in scene.injected_now]
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


def _injected(scene: Scene) -> RenderableType:
    """The faults that are on, in one line."""
    now = scene.injected_now
    text = (
        f"injecting {', '.join(now)}"
        if now
        else f"{len(scene.setting.faults)} fault(s) to inject, none on now"
    )
    return Text(text, "bold red" if now else "dim", no_wrap=True, overflow="ellipsis")


def _found(scene: Scene) -> RenderableType:
    """What the daemon has found wrong with its sensors, in one line beneath: it knows nothing of the other."""
    found = [f"{name} {fault_text(s['fault'])}" for name, s in _readings(scene) if s.get("fault")]
    text = f"found     {', '.join(found) or 'nothing wrong'}"
    return Text(text, "bold yellow" if found else "dim", no_wrap=True, overflow="ellipsis")


def _table(first: str, columns: list[str], last: str, wide: bool) -> Table:
    """A table of numbers between a name and something to look at."""
    table = Table(box=box.SIMPLE_HEAD, padding=(0, int(wide)), pad_edge=False, show_edge=False)
    table.add_column(first, width=LABEL, no_wrap=True)
    for name in columns:
        table.add_column(name, justify="right", width=10, no_wrap=True)
    table.add_column(last, no_wrap=True)
    return table


def _shown(scene: Scene, most: int) -> list[str]:
    """The states that there is room for: what is watched, then what truth knows, then the rest."""
    known = {} if scene.truth is None else scene.truth
    order = sorted(
        scene.setting.units, key=lambda name: (name not in scene.setting.watched, name not in known)
    )
    chosen = order[: max(3, most)]
    return [name for name in scene.setting.units if name in chosen]


def _states(scene: Scene, wide: bool, shown: Sequence[str]) -> RenderableType:
    columns = ["estimate", "3 sigma", "truth", "error"]
    table = _table(
        "state", columns if wide else [c for c in columns if c != "truth"], "error in 3 sigma", wide
    )
    estimate: Mapping[str, Any] = scene.estimate or {"state": {}, "std": {}}
    for name in shown:
        unit = scene.setting.units[name]
        value, std, error = estimate["state"].get(name), estimate["std"].get(name), scene.error(name)
        label = Text.assemble(name.replace("_", " "), (f" {unit.replace('_', '/')}", "dim"))
        numbers, bar = dict.fromkeys(columns, Text("-")), Text()
        if value is not None and std is not None:
            numbers |= {"estimate": Text(f"{value:.5f}", "bold"), "3 sigma": Text(f"±{3 * std:.5f}")}
        if value is not None and std is not None and error is not None:
            numbers |= {"truth": Text(f"{value - error:.5f}"), "error": Text(f"{error:+.5f}")}
            half = 8 if wide else 6
            bar = Text(chart.deviation(error, 3 * std, half), "green" if abs(error) <= 3 * std else "red")
        table.add_row(label, *(numbers[c] for c in columns if wide or c != "truth"), bar)
    return table


def _sensors(scene: Scene, wide: bool) -> RenderableType:
    table = _table("sensor", ["rate", "used", "rejected", "lost"], "health", wide)
    for name, sensor in _readings(scene):
        health, fault = str(sensor["health"]), sensor.get("fault")
        said = f"{health}: {fault['kind']}" if wide and fault and fault["kind"] != health else health
        table.add_row(
            name, f"{sensor['rate_hz']:.0f} /s", f"{sensor['used']}", f"{_refused(sensor)}", f"{sensor['lost']}",
            Text(said, COLOURS.get(health, "white")),
        )  # fmt: skip
    return table


def _path(scene: Scene, width: int, height: int) -> RenderableType:
    """The watched state over time, towards the goal where there is one, in so many cells."""
    goal_m, name = scene.setting.goal_m, scene.setting.watched[0]
    unit = scene.setting.units.get(name, "").replace("_", "/")
    values = [p for _, truth, estimate in scene.path for p in (truth, estimate)]
    values += [goal_m] if goal_m is not None else []
    low, high = min(values, default=0.0), max(values, default=0.0)
    margin = 0.08 * max(high - low, 0.05)
    y_range = (low - margin, high + margin)
    points = [(t_s, estimate) for t_s, _, estimate in scene.path]
    goal_row = -1 if goal_m is None else chart.rule(goal_m, y_range, height)
    grid = Table.grid(padding=(0, 1))
    for row, dots in enumerate(chart.curve(points, scene.setting.duration_s, y_range, width, height)):
        label = Text()
        if row == goal_row:
            label = Text(f"goal {goal_m:g} m".rjust(12), "yellow")
        elif row in (0, height - 1):
            label = Text(f"{y_range[row == 0]:.2f} {unit}".rjust(12), "dim")
        drawn = Text()
        for cell in dots:
            drawn.append(
                *((cell, "cyan") if cell != " " else ("┄" if row == goal_row else " ", "yellow dim"))
            )
        grid.add_row(label, drawn)
    return Group(Text(f"{name} over time", "dim"), grid)


def _plan(scene: Scene, width: int, height: int) -> RenderableType:
    """Both watched states over each other, in so many cells: what is estimated before what is true."""
    x_range, y_range = (_range([v for row in scene.plan for v in row[k::2]]) for k in (0, 1))
    # a cell is about twice as high as it is wide, so that a square may be one
    columns = min(width, max(8, round(2.0 * height * (x_range[1] - x_range[0]) / (y_range[1] - y_range[0]))))
    span = x_range[1] - x_range[0]
    layers = [
        chart.curve([(row[k] - x_range[0], row[k + 1]) for row in scene.plan], span, y_range, columns, height)
        for k in (2, 0)
    ]
    grid = Table.grid(padding=(0, 1))
    for number, (estimated, true) in enumerate(zip(*layers, strict=True)):
        label = Text(f"{y_range[number == 0]:.2f} m".rjust(12) if number in (0, height - 1) else "", "dim")
        drawn = Text()
        for one, other in zip(estimated, true, strict=True):
            drawn.append(*((one, "cyan") if one != " " else (other, "dim")))
        grid.add_row(label, drawn)
    names = " over ".join(reversed(scene.setting.watched))
    return Group(Text(f"{names}: estimate, and truth where it is elsewhere (dim)", "dim"), grid)


def _range(values: Sequence[float]) -> tuple[float, float]:
    """From the least to the greatest, with a margin."""
    low, high = min(values), max(values)
    margin = 0.08 * max(high - low, 0.05)
    return low - margin, high + margin


def _readings(scene: Scene) -> list[tuple[str, Mapping[str, Any]]]:
    """The sensors that sent anything, or should have."""
    if scene.status is None:
        return []
    return [(name, s) for name, s in scene.status["sensors"].items() if name != "reference" or s["used"]]


def _refused(sensor: Mapping[str, Any]) -> int:
    """Readings that were not used, and what was no reading."""
    return int(sensor["rejected"] + sensor["late"] + sum(sensor["refused"].values()))
