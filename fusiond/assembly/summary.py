"""What `fusiond check` prints: everything a configuration implies."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from fusiond.assembly.assembly import Assembly
from fusiond.assembly.observability import observability, without_each
from fusiond.types import NANOSECONDS


def _sensor(assembly: Assembly, number: int) -> dict[str, Any]:
    """One sensor: what it sends, what is derived for it."""
    sensor, design = assembly.resolved.sensors[number], assembly.design[0]
    silence_ns = int(design["silence_ns"][number])
    return {
        "name": sensor.name,
        "role": sensor.role.label,
        "key": assembly.config.key_of(sensor.name),
        "channels": [slot.key for slot in sensor.model.channels],
        "max_silence_s": silence_ns / NANOSECONDS if silence_ns else None,
    }


def summary(assembly: Assembly) -> dict[str, Any]:
    """States, sensors, observability and record sizes, ready for JSON.

    `diagnosability`, `thresholds` and `margins` stay empty where nothing is derived for them.
    """
    resolved, layout = assembly.resolved, assembly.layout
    whole = observability(resolved, resolved.updating)
    return {
        "name": layout.name,
        "states": [slot.name for slot in layout.states],
        "units": {slot.name: slot.unit for slot in layout.states},
        "outputs": [slot.name for slot in layout.outputs],
        "inputs": [slot.name for slot in layout.inputs],
        "sensors": [_sensor(assembly, number) for number in range(len(resolved.sensors))],
        "observability": {
            **asdict(whole),
            "without": {name: asdict(seen) for name, seen in without_each(resolved).items()},
        },
        "diagnosability": [],
        "thresholds": {},
        "margins": {},
        "filters": [f"{row.hears} {row.sensor}".strip() for row in layout.filters],
        "bytes": {"track": layout.track.itemsize, "report": layout.report.itemsize},
        "reordered_within_s": resolved.config.history.horizon_s,
    }
