"""What a recording says about its own records: names, units and dtypes, as JSON, so that it explains itself."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fusiond.engine.layout import Layout, SensorLayout
from fusiond.types import Role, Slot

SLOTS = ("states", "errors", "outputs", "inputs", "controls", "references")


@dataclass(frozen=True, slots=True)
class Description:
    """Names and units of one recording, as `describe` wrote them."""

    name: str
    states: tuple[Slot, ...]
    errors: tuple[Slot, ...]
    outputs: tuple[Slot, ...]
    inputs: tuple[Slot, ...]
    controls: tuple[Slot, ...]
    references: tuple[Slot, ...]
    sensors: tuple[SensorLayout, ...]


def describe(layout: Layout) -> str:
    """The names and units of a layout as JSON."""
    slots = {field: [[slot.name, slot.unit] for slot in getattr(layout, field)] for field in SLOTS}
    sensors = [
        {
            "name": sensor.name,
            "number": sensor.number,
            "role": sensor.role.label,
            "channels": [[slot.name, slot.unit] for slot in sensor.channels],
        }
        for sensor in layout.sensors
    ]
    return json.dumps({"name": layout.name, **slots, "sensors": sensors})


def description_of(text: str) -> Description:
    """Read what `describe` wrote. Raises: ValueError, KeyError or TypeError where it is something else."""
    content = json.loads(text)
    sensors = tuple(
        SensorLayout(s["name"], int(s["number"]), Role[s["role"].upper()], slots_of(s["channels"]))
        for s in content["sensors"]
    )
    slots = {field: slots_of(content[field]) for field in SLOTS}
    return Description(name=content["name"], sensors=sensors, **slots)


def slots_of(pairs: list[list[str]]) -> tuple[Slot, ...]:
    """Slots of a list of [name, unit]."""
    return tuple(Slot(name, unit) for name, unit in pairs)


def dtype_text(dtype: np.dtype[Any]) -> str:
    """A packed record dtype as JSON: [[name, little-endian type, [shape]], ...]."""
    fields: Mapping[str, Any] = dtype.fields or {}
    return json.dumps(
        [[name, fields[name][0].base.str, list(fields[name][0].shape)] for name in dtype.names or ()]
    )


def dtype_of(text: str) -> np.dtype[Any]:
    """The dtype that `dtype_text` wrote. Raises: ValueError or TypeError where it is something else."""
    content = json.loads(text)
    if not all(kind[1:2] in "if" + "u" for _, kind, _ in content):
        raise ValueError("a record holds numbers only")
    return np.dtype((np.record, [(name, kind, tuple(shape)) for name, kind, shape in content]))
