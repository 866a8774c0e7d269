"""What was found of the faults that were injected: a part of the verdict for each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from fusiond.demo.verdict import Check
from fusiond.recording.fault_words import SIZELESS, fault_text
from fusiond.recording.summary import Summary
from fusiond.simulation.faults import Fault, Kind
from fusiond.types import seconds

NAMES = {Kind.BROKEN: "silent", Kind.INTERMITTENT: "silent", Kind.NAN: "garbage"}
"""What a fault is called by who finds it, where that is not how it was injected."""
AFTER_S = 1.0
"""A fault that is over may still be found by what it left behind, so long after its end."""
SOONER_S = 0.5
"""An onset is estimated: it may be named so much before it was."""


def found_checks(
    faults: Sequence[Fault], summary: Summary, end_s: float, *, detects: bool
) -> tuple[Check, ...]:
    """One part of the verdict for each injected fault, in the order given, and one for what was found beside them.

    Args:
        faults: their times are those of the run.      end_s: of the run.
        detects: whether the configuration asks for faults to be found.
    """
    if not detects:
        text = "the configuration has no [faults] section, so nobody looked"
        return tuple(Check(f"found {fault}", None, text) for fault in faults)
    checks = [found_check(fault, summary.sensors[fault.sensor].faults, end_s) for fault in faults]
    return (*checks, nobody_else(faults, summary))


def found_check(fault: Fault, entries: Sequence[Mapping[str, Any]], end_s: float) -> Check:
    """Whether one injected fault was found, called by its name, after how long, and how far off its size was.

    Args:
        entries: what was found wrong with its sensor.
    """
    name, wanted, begin_s = f"found {fault}", NAMES.get(fault.kind, fault.kind.value), seconds(fault.start_ns)
    if fault.harmless:
        return Check(name, None, "its size makes it no fault")
    if fault.kind is Kind.SPIKE:
        return Check(name, None, "a single reading changes no sensor's health; see the readings rejected")
    if begin_s >= end_s:
        return Check(name, None, "the run ended before it began")
    mine = [entry for entry in entries if _overlaps(entry, fault)]
    if not mine:
        return Check(name, False, f"not found within {min(end_s, _end_s(fault)) - begin_s:.2f} s")
    named = next((entry for entry in mine if entry["kind"] == wanted), None)
    entry = named or mine[0]
    text = f"after {entry['detected_s'] - begin_s:.3f} s as {fault_text(dict(entry))}"
    if named is None:
        return Check(name, False, f"{text}; it is {wanted}")
    return Check(name, True, f"{text}; {_errors(fault, entry)}")


def nobody_else(faults: Sequence[Fault], summary: Summary) -> Check:
    """Whether sensors that did not lie were left alone: no fault of theirs, unless said to be one of several."""
    lied = {fault.sensor for fault in faults}
    accused = [
        f"{name} {fault_text(entry)}"
        for name, sensor in summary.sensors.items()
        if name not in lied
        for entry in sensor.faults
    ]
    if not accused:
        return Check("nobody else", True, "no fault was found with any sensor that had none")
    return Check("nobody else", False, "; ".join(accused))


def _overlaps(entry: Mapping[str, Any], fault: Fault) -> bool:
    """Whether something found may be this fault: detected while it was there, and not begun before."""
    begin_s = seconds(fault.start_ns)
    soon = begin_s <= entry["detected_s"] <= _end_s(fault) + AFTER_S
    return bool(soon and entry["onset_s"] >= begin_s - SOONER_S)


def _end_s(fault: Fault) -> float:
    return seconds(fault.end_ns)


def _errors(fault: Fault, entry: Mapping[str, Any]) -> str:
    """How far size and onset are off, and when it was taken back."""
    parts = []
    if entry["kind"] not in SIZELESS:
        error, std = entry["size"] - fault.size, entry["size_std"]
        parts.append(f"size off by {error:+.3g}" + (f" ({abs(error) / std:.1f} std)" if std > 0.0 else ""))
    parts.append(f"onset by {entry['onset_s'] - seconds(fault.start_ns):+.3f} s")
    if fault.duration_ns is not None and entry["cleared_s"] is not None:
        parts.append(f"taken back {entry['cleared_s'] - _end_s(fault):.2f} s after its end")
    return ", ".join(parts)
