"""What commands print for people. Results go to stdout, progress to stderr and only where somebody watches."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

from fusiond.cli.explaining import found_lines, screen

console = screen()


@contextmanager
def counting(what: str) -> Iterator[Callable[[int], None]]:
    """A spinner that counts readings; yields the function to tell it how many there were so far."""
    columns = (
        SpinnerColumn(),
        TextColumn(what),
        TextColumn("{task.completed:,.0f} readings"),
        TimeElapsedColumn(),
    )
    stderr = Console(stderr=True)
    with Progress(*columns, console=stderr, transient=True, disable=not stderr.is_terminal) as progress:
        task = progress.add_task(what, total=None)
        yield lambda count: progress.update(task, completed=count)


@contextmanager
def working(what: str, *, long: bool = False) -> Iterator[None]:
    """A spinner while something takes its time; what takes `long` is told to a file too."""
    stderr = Console(stderr=True, soft_wrap=True)
    if stderr.is_terminal:
        with stderr.status(what):
            yield
    else:
        if long:
            stderr.print(f"{what} ...")
        yield


def table_of(title: str, *columns: str) -> Table:
    """A plain table whose first column is left, the others right aligned."""
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for place, column in enumerate(columns):
        table.add_column(column, justify="left" if place == 0 else "right")
    return table


def number(value: float | None) -> str:
    """Six digits, or a dash."""
    return "-" if value is None else f"{value:.6g}"


def counted(counts: Mapping[str, int]) -> str:
    """`gated 3, late 1`."""
    return ", ".join(f"{name} {count}" for name, count in counts.items() if count) or "none"


def show_check(result: Mapping[str, Any]) -> None:
    """What a configuration implies."""
    seen = result["observability"]
    console.print(f"[bold]{result['name']}[/bold]: {', '.join(result['states'])}")
    if result["inputs"]:
        console.print(f"driven by {', '.join(result['inputs'])}")
    unseen = f"; unobserved, as accepted: {', '.join(seen['unobserved'])}" if seen["unobserved"] else ""
    console.print(f"observability: rank {seen['rank']} of {seen['states']}{unseen}")
    table = table_of("", "sensor", "role", "channels", "silent after", "without it unobserved")
    for sensor in result["sensors"]:
        without = seen["without"].get(sensor["name"])
        lost = "" if without is None else ", ".join(without["unobserved"]) or "nothing"
        silence = "never" if sensor["max_silence_s"] is None else f"{sensor['max_silence_s']:.3g} s"
        table.add_row(sensor["name"], sensor["role"], " ".join(sensor["channels"]), silence, lost)
    console.print(table)
    console.print(
        f"filters: {_filters(result['filters'])}; {result['bytes']['track']} bytes of state; "
        f"readings up to {result['reordered_within_s']:g} s late are put in their place"
    )


def _filters(names: Sequence[str]) -> str:
    """`all, without y1`; those of one name, which share a sensor's levels of noise, counted."""
    return ", ".join(name if count == 1 else f"{count} x {name}" for name, count in Counter(names).items())


def show_adaptation(result: Mapping[str, Any]) -> None:
    """What is done about noise that is not as declared."""
    if not result:
        console.print("noise: as declared; a section \\[adaptation] has it estimated")
        return
    console.print(f"noise: estimated, {result['method']}: {result['form']}")
    for name, channels in result["sensors"].items():
        spans = ", ".join(f"{key} {low:.3g} to {high:.3g}" for key, (low, high) in channels.items())
        console.print(f"  {name}: deviations believed: {spans}")
    if result["as_declared"]:
        console.print(f"  as declared: {', '.join(result['as_declared'])}")


def show_replay(result: Mapping[str, Any]) -> None:
    """The outcome of a replay."""
    rate = result["readings"] / result["wall_s"] if result["wall_s"] else 0.0
    console.print(f"{result['readings']:,} readings in {result['wall_s']:.2f} s ({rate:,.0f} a second)")
    final = result["final"]
    if final:
        smoothed = (result.get("smoothed") or {}).get("rmse") or {}
        columns = ["state", "value", "std", *(["RMSE"] if result.get("rmse") else [])]
        columns += ["smoothed"] if smoothed else []
        table = table_of(f"at {final['t_s']:.3f} s, {final['health']}", *columns)
        rmse = result.get("rmse") or {}
        names = [
            *final["state"],
            *(final["std"].keys() - final["state"].keys()),
            *(rmse.keys() - final["state"].keys()),
        ]
        for name in dict.fromkeys(names):
            cells = [number(column.get(name)) for column in (final["state"], final["std"])]
            cells += [number(rmse.get(name))] if rmse else []
            table.add_row(name, *cells, *([number(smoothed.get(name))] if smoothed else []))
        console.print(table)
    if result.get("nees_mean") is not None:
        console.print(
            f"mean NEES {result['nees_mean']:.3f} (a consistent filter: {result.get('nees_dof', '?')})"
        )
    if "smoothed" in result:
        _show_smoothed(result["smoothed"])
    table = table_of("", "sensor", "used", "rejected", "late", "mean NIS", "health")
    for name, sensor in result["sensors"].items():
        counts = (str(sensor[key]) for key in ("used", "rejected", "late"))
        table.add_row(name, *counts, number(sensor["nis_mean"]), sensor["health"])
    console.print(table)
    for found in found_lines(result):
        console.print(found, markup=False, highlight=False)
    console.print(f"refused: {counted(result.get('refused', {}))}")
    console.print(f"output_sha256 {result['output_sha256']}")
    for warning in result.get("warnings", []):
        console.print(f"[yellow]{warning}[/yellow]")


def _show_smoothed(smoothed: Mapping[str, Any]) -> None:
    """The run smoothed from its end, beside the filter."""
    parts = f" in {smoothed['segments']} parts" if smoothed["segments"] > 1 else ""
    table = table_of(
        f"smoothed: {smoothed['updates']:,} updates{parts}", "std, root mean square", "filter", "smoothed"
    )
    for name, std in smoothed["std"].items():
        table.add_row(name, number(smoothed["filter_std"][name]), number(std))
    console.print(table)
    if smoothed.get("nees_mean") is not None:
        console.print(
            f"mean NEES, smoothed {smoothed['nees_mean']:.3f} (a consistent smoother: {smoothed['nees_dof']})"
        )


def show_import(imported: Any, out: Path) -> None:
    """What was imported."""
    console.print(f"{out}: {sum(imported.readings.values()):,} readings")
    for name, count in imported.readings.items():
        console.print(f"  {name}: {count:,}")
    if imported.truth is not None:
        rows, path = imported.truth
        console.print(f"{path}: {rows:,} rows of truth")
    for warning in imported.refusals.messages():
        console.print(f"[yellow]{warning}[/yellow]")


def show_diff(difference: Any) -> None:
    """Where two runs differ."""
    for note in difference.notes:
        console.print(note)
    if difference.equal:
        console.print(f"equal: {difference.reports[0]:,} reports, the same bits")
        return
    console.print(f"{difference.differing:,} of {min(difference.reports):,} reports differ")
    if difference.first is not None:
        console.print(f"first: {difference.first.text()}")
    for field, largest in difference.largest.items():
        console.print(f"  {field}: at most {largest:.6g}")
