"""The answer of `status` for people: the estimate, every sensor, and whatever else is not as it should be."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rich.table import Table

from fusiond.cli.views import console, counted, number, table_of
from fusiond.recording.fault_words import fault_text

Answer = Mapping[str, Any]


def show_status(answer: Answer) -> None:
    """Print the tables of one daemon."""
    where = ", ".join(answer["endpoints"])
    console.print(
        f"[bold]{answer['name']}[/bold]: {answer['service']}, up {answer['uptime_s']:.0f} s, "
        f"{answer['readings']:,} readings, pid {answer['pid']}, {answer['mode']} at {where}"
    )
    if answer["estimate"]:
        console.print(estimate_table(answer["estimate"]))
    console.print(sensor_table(answer["sensors"]))
    for line in remarks(answer):
        console.print(line, markup=False)


def estimate_table(estimate: Answer) -> Table:
    """States with their standard deviations, and what is derived from them."""
    table = table_of(f"at {estimate['t']:.3f} s", "state", "value", "std")
    for name in dict.fromkeys([*estimate["state"], *estimate["std"]]):
        table.add_row(name, number(estimate["state"].get(name)), number(estimate["std"].get(name)))
    for name, value in estimate.get("outputs", {}).items():
        table.add_row(name, number(value), "")
    return table


def sensor_table(sensors: Mapping[str, Answer]) -> Table:
    """A row for each sensor, within 80 columns; a reading is used, rejected or late, or was none."""
    table = table_of("", "sensor", "per s", "used", "rejected", "late", "lost", "unread", "health")
    for name, sensor in sensors.items():
        counts = [str(sensor[key]) for key in ("used", "rejected", "late", "lost")]
        none = str(sum(sensor["refused"].values()))
        health = str(sensor["health"]) if sensor["heard"] else "never heard"
        table.add_row(name, f"{sensor['rate_hz']:.1f}", *counts, none, health)
    return table


def remarks(answer: Answer) -> Iterator[str]:
    """What there is to say beside the tables; nothing about what is as it should be."""
    for name, sensor in answer["sensors"].items():
        if sensor["fault"] and sensor["heard"]:
            yield f"{name}: {fault_text(sensor['fault'])}"
    if answer.get("group"):
        found = ", ".join(f"rank {one['rank']} {one['state']}" for one in answer["group"]["members"])
        yield f"group: {found}; rank {answer['group']['rank']} answers"
    if answer["model"]["alarm"]:
        yield "model alarm: the model does not describe what is measured"
    if answer["resets"]:
        yield f"resets: {answer['resets']}"
    if answer["repairs"]:
        guard = answer["guard"]
        yield (
            f"covariance: repaired {answer['repairs']} times, the largest change {number(guard['largest'])}, "
            f"the last {number(guard['last'])} standard deviations"
        )
    if answer["refused"]:
        yield f"no readings: {counted(answer['refused'])}"
    queue = answer["queue"]
    if queue["dropped"]:
        yield f"queue: {queue['dropped']} puts dropped, {queue['waiting']} of {queue['capacity']} waiting"
    recording = answer["recording"]
    if recording:
        dropped = counted(recording["dropped"])
        yield f"recording: {recording['error'] or 'running'}, dropped {dropped}"
