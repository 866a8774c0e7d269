"""A sensor's fault as people and programs read it: the object of `faults`, `event`, `health`, `why`, and one line."""

from __future__ import annotations

from typing import Any

from fusiond.engine.layout import Layout
from fusiond.types import Kind, seconds

KIND_LABELS = [kind.label for kind in Kind]
SIZELESS = frozenset({Kind.STUCK.label, Kind.SILENT.label, Kind.GARBAGE.label})
"""Kinds that have no size: theirs is given as 0."""
UNITS = {Kind.NOISE.label: "", Kind.SCALE.label: "", Kind.DELAY.label: "s"}
"""Where the size is not in the channel's unit; noise and scale are factors."""

FaultObject = dict[str, Any]


def fault_object(layout: Layout, report: Any, number: int) -> FaultObject | None:
    """What one report says is wrong with a sensor; None where nothing is.

    Args:
        report: one record of `layout.report`.      number: of the sensor.
    Returns:
        `kind`; `channel`, counted from 0, null where it is all of them; `onset_s`; `size` with `size_std` in `unit`
        (a drift per second; noise and scale as factors); `ambiguous_with`, names of sensors it cannot be told from.
    """
    kind = Kind(int(report["fault"][number]))
    if kind is Kind.NONE:
        return None
    channel = int(report["fault_channel"][number])
    mask = int(report["suspects"][number])
    return {
        "kind": kind.label,
        "channel": None if channel < 0 else channel,
        "onset_s": seconds(int(report["fault_onset_ns"][number])),
        "size": float(report["fault_size"][number]),
        "size_std": float(report["fault_std"][number]),
        "unit": _unit(layout, kind, number, channel),
        "ambiguous_with": [sensor.name for sensor in layout.sensors if mask >> sensor.number & 1],
    }


def _unit(layout: Layout, kind: Kind, number: int, channel: int) -> str:
    """Unit of the size; empty where there is none, or where channels of several units share it."""
    if kind.label in SIZELESS:
        return ""
    if kind.label in UNITS:
        return UNITS[kind.label]
    channels = layout.sensors[number].channels
    units = {slot.unit for slot in (channels if channel < 0 else channels[channel : channel + 1])}
    unit = units.pop().replace("_", "/") if len(units) == 1 else ""
    return f"{unit or '1'}/s" if kind is Kind.DRIFT else unit


def fault_text(fault: FaultObject) -> str:
    """`bias +0.5012 +-0.0110 m on channel 0 since 10.020 s, or ultrasonic`."""
    words = [str(fault["kind"])]
    if fault["kind"] not in SIZELESS:
        sign = "" if fault["kind"] in UNITS else "+"
        words.append(f"{fault['size']:{sign}.4g} +-{fault['size_std']:.2g}")
        words += [fault["unit"]] if fault["unit"] else []
    if fault["channel"]:
        words.append(f"on channel {fault['channel']}")
    words.append(f"since {fault['onset_s']:.3f} s")
    others = " or ".join(fault["ambiguous_with"])
    return " ".join(words) + (f"; it may as well be {others}" if others else "")
