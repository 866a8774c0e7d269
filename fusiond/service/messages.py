"""The messages that go out, as JSON: `estimate`, `control`, `health`, `event`, `report/SENSOR`.

Every one carries `seq` (of its own kind, from 1) and `epoch` (start of this process's engine, ms since 1970): the
pair only ever grows, so a gap is a loss and an older epoch is a ghost. A number that is not finite never goes out:
where the state is none, `state` and `std` are empty and the health is `invalid`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from fusiond.engine.layout import Layout
from fusiond.recording.decimal_time import seconds_text
from fusiond.types import Action, Health, ServiceHealth, Slot, Verdict

SERVICE_LABELS = [health.label for health in ServiceHealth]
HEALTH_LABELS = [health.label for health in Health]
INVALID = ServiceHealth.INVALID.label


class EstimateText:
    """Estimates of one layout as JSON, by a template: several times as fast as building the objects."""

    def __init__(self, layout: Layout) -> None:
        state = template(slot.name for slot in layout.states)
        head = '{"t": %s, "t_ns": %d, "seq": %d, "epoch": %d, "resets": %d, '
        self._whole = head + f'"state": {{{state}}}, "std": {{{state}}}, %s"health": "%s"}}'
        self._empty = head + '"state": {}, "std": {}, "health": "%s"}' % INVALID

    def text(
        self, t_ns: int, seq: int, epoch: int, resets: int, x: Sequence[float], std: Sequence[float], service: int,
        outputs: Mapping[str, float],
    ) -> str:  # fmt: skip
        """One estimate; `outputs` (numbers derived from the state) stand in it where the model has any."""
        head = (seconds_text(t_ns), t_ns, seq, epoch, resets)
        if not math.isfinite(sum(x) + sum(std)):
            return self._empty % head
        derived = f'"outputs": {dumps(finite(outputs))}, ' if outputs else ""
        return self._whole % (*head, *x, *std, derived, SERVICE_LABELS[service])


class ControlText:
    """Commands of one layout as JSON."""

    def __init__(self, controls: Iterable[Slot]) -> None:
        u = template(slot.name for slot in controls)
        head = '{"t": %s, "t_ns": %d, "seq": %d, "epoch": %d, '
        self._text = head + f'"u": {{{u}}}, "valid": %s, "age_s": %r, "level": "%s"}}'

    def text(
        self, t_ns: int, seq: int, epoch: int, u: Sequence[float], valid: bool, age_s: float, service: int
    ) -> str:  # fmt: skip
        """One command.

        Args:
            u: what the actuator should do.      valid: whether it may be followed.
            age_s: from the last reading that corrected the state to the command; level: `service`, as a word.
        """
        sound = all(map(math.isfinite, u))
        values = tuple(u) if sound else (0.0,) * len(u)
        flag = "true" if valid and sound else "false"
        level = SERVICE_LABELS[service]
        return self._text % (seconds_text(t_ns), t_ns, seq, epoch, *values, flag, age_s, level)


def template(names: Iterable[str]) -> str:
    """`"name": %r, ...`: the inside of a JSON object to be filled with finite floats."""
    return ", ".join(f"{json.dumps(name)}: ".replace("%", "%%") + "%r" for name in names)


def health_message(
    t_ns: int, seq: int, epoch: int, service: int, sensors: Mapping[str, int]
) -> dict[str, Any]:
    """Health of the service and of every sensor, by name."""
    labels = {name: HEALTH_LABELS[health] for name, health in sensors.items()}
    head = {"t": t_ns / 1e9, "t_ns": t_ns, "seq": seq, "epoch": epoch}
    return head | {"service": SERVICE_LABELS[service], "sensors": labels}


def event_message(
    t_ns: int, seq: int, epoch: int, sensor: str | None, before: str, after: str
) -> dict[str, Any]:
    """One transition of health; `sensor` is null for the service's own. `fault` is null until faults are named."""
    return {
        "t": t_ns / 1e9, "t_ns": t_ns, "seq": seq, "epoch": epoch, "id": f"{epoch}-{seq}", "sensor": sensor,
        "from": before, "to": after, "fault": None,
    }  # fmt: skip


def report_message(report: Any, layout: Layout, seq: int, epoch: int) -> dict[str, Any]:
    """One report, every number by its field's name; what is not finite (an unlimited gate) is null."""
    sensor = layout.sensors[int(report["sensor"])]
    shown = {
        name: finite_list(report[name][: int(report["dof"])])
        for name in ("nu", "S", "e", "R_used", "R_declared")
    }
    numbers = {name: finite_number(report[name]) for name in ("nis", "limit")}
    t_ns = int(report["t_ns"])
    return {
        "t": t_ns / 1e9, "t_ns": t_ns, "seq": seq, "epoch": epoch, "sensor": sensor.name,
        "reading_seq": int(report["seq"]), "arrival_ns": int(report["arrival_ns"]),
        "verdict": Verdict(int(report["verdict"])).label, "action": Action(int(report["action"])).label,
        "z": finite_list(report["z"][: int(report["length"])]), **shown, **numbers,
        "health": HEALTH_LABELS[int(report["health"][sensor.number])],
        "service": SERVICE_LABELS[int(report["service"])],
    }  # fmt: skip


def finite_number(value: Any) -> float | None:
    """The number, or None (null) where it is not finite."""
    number = float(value)
    return number if math.isfinite(number) else None


def finite_list(values: Any) -> list[float | None]:
    """A list of numbers, None for what is not finite."""
    return [finite_number(value) for value in values]


def finite(values: Mapping[str, float]) -> dict[str, float | None]:
    """Numbers by name, None for what is not finite."""
    return {name: finite_number(value) for name, value in values.items()}


def dumps(message: Any) -> str:
    """JSON that every reader accepts: NaN and Infinity raise ValueError instead of going out."""
    return json.dumps(message, allow_nan=False)
