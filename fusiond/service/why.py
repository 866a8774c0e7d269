"""`why SENSOR`: the decisions about the last readings of a sensor, or about those at a time, from the report ring."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.recording.fault_log import now_ns
from fusiond.recording.fault_words import fault_object
from fusiond.service.admin import Refusal
from fusiond.service.messages import HEALTH_LABELS
from fusiond.service.report_ring import ReportRing
from fusiond.types import Action, Role, Verdict, nanoseconds, seconds

READINGS, MOST_READINGS = 12, 500
"""Readings told of where nobody says how many, and at most."""


def why(ring: ReportRing, layout: Layout, asked: Mapping[str, Any]) -> dict[str, Any]:
    """The answer to one question.

    Args:
        asked: `sensor`; `at`, time in s, without it now; `last`, readings wanted.
    Returns:
        `sensor`, `role`, `covers_s` (first and last time kept; null where nothing is), `turns` of its health up to
        then, and `readings`: the last ones, or those around `at`.
    Raises: Refusal.
    """
    sensor = layout.sensor(str(asked.get("sensor", "")))
    if sensor is None:
        known = ", ".join(one.name for one in layout.sensors)
        raise Refusal(
            "unknown", f"why {asked.get('sensor', '')}: no sensor of that name; ask about one of {known}"
        )
    last = int(_number(asked, "last", READINGS))
    if not 1 <= last <= MOST_READINGS:
        raise Refusal(
            "malformed", f"why {sensor.name}: last = {last} (limits 1 to {MOST_READINGS}); choose another"
        )
    at_s = _number(asked, "at", None)
    reports = ring.reports(sensor.number)
    turns = ring.turns(sensor.number)
    end_ns = None if at_s is None else nanoseconds(at_s)
    return {
        "sensor": sensor.name,
        "role": Role(sensor.role).label,
        "at_s": at_s,
        "covers_s": [seconds(now_ns(reports[k])) for k in (0, -1)] if len(reports) else None,
        "turns": _turns(turns, layout, sensor.number),
        "readings": [reading(report, layout) for report in _around(reports, end_ns, last)],
    }


def _number(asked: Mapping[str, Any], name: str, default: float | None) -> Any:
    """A number of the question, or the default. Raises: Refusal."""
    said = asked.get(name)
    if said is None or said == "":
        return default
    try:
        value = float(said)
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value) or abs(value) > 1e10:
        raise Refusal(
            "malformed", f"why: {name} = {said!r} is no number that can be meant; give one, or leave it out"
        )
    return value


def _around(reports: NDArray[Any], at_ns: int | None, last: int) -> NDArray[Any]:
    """The last reports, or as many with the given time in their middle."""
    if at_ns is None or not len(reports):
        return reports[-last:]
    middle = int(np.searchsorted([now_ns(report) for report in reports], at_ns, side="right"))
    first = max(0, min(middle - (last + 1) // 2, len(reports) - last))
    return reports[first : first + last]


def _turns(turns: NDArray[Any], layout: Layout, number: int) -> list[dict[str, Any]]:
    """What the sensor turned to, and when."""
    return [
        {
            "t_s": seconds(now_ns(report)),
            "to": HEALTH_LABELS[int(report["health"][number])],
            "fault": fault_object(layout, report, number),
        }
        for report in turns
    ]


def reading(report: Any, layout: Layout) -> dict[str, Any]:
    """One decision: everything it was made of. Vectors have one number for each measured channel."""
    number, dof = int(report["sensor"]), int(report["dof"])
    arrival_ns, t_ns = int(report["arrival_ns"]), int(report["t_ns"])
    vectors = {name: report[name][:dof].tolist() for name in ("nu", "S", "R_used", "R_declared")}
    return vectors | {
        "t_s": seconds(t_ns),
        "delay_s": seconds(arrival_ns - t_ns) if arrival_ns else None,
        "z": report["z"][: int(report["length"])].tolist(),
        "nis": float(report["nis"]) if dof else None,
        "dof": dof,
        "limit": float(report["limit"]) if dof and np.isfinite(report["limit"]) else None,
        "verdict": Verdict(int(report["verdict"])).label,
        "health": HEALTH_LABELS[int(report["health"][number])],
        "fault": fault_object(layout, report, number),
        "action": Action(int(report["action"])).label,
    }
