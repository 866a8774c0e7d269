"""The messages that go out, as JSON: `estimate`, `control`, `health`, `event`, `report/SENSOR`.

Every one carries `seq` (of its own kind, from 1) and `epoch` (since when this daemon speaks, ms since 1970): the
pair only ever grows, so a gap is a loss and an older epoch is a ghost. A standby that takes over goes on counting.
`t` is in seconds, `t_ns` is the same exactly.
A number that is not finite never goes out: where the state is none, `state` and `std` are empty and the health is
`invalid`; elsewhere it is null.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import orjson

from fusiond.control.levels import Level
from fusiond.engine.layout import Layout
from fusiond.recording.fault_words import FaultObject, fault_object
from fusiond.types import Action, Health, ServiceHealth, Verdict

SERVICE_LABELS = [health.label for health in ServiceHealth]
LEVEL_LABELS = [level.label for level in Level]
HEALTH_LABELS = [health.label for health in Health]
INVALID = ServiceHealth.INVALID.label

Message = dict[str, Any]


def head(t_ns: int, seq: int, epoch: int) -> Message:
    """What every message begins with."""
    return {"t": t_ns / 1e9, "t_ns": t_ns, "seq": seq, "epoch": epoch}


class EstimateMessage:
    """Estimates of one layout."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._names = [slot.name for slot in layout.states]
        self._errors = [slot.name for slot in layout.errors]
        self._protected = [slot.name for slot in layout.protected]

    def content(
        self, t_ns: int, seq: int, epoch: int, resets: int, jump: Sequence[float], x: Sequence[float],
        std: Sequence[float], service: int, outputs: Mapping[str, float] | None, protection: Sequence[float] = (),
        unobserved: int = 0,
    ) -> Message:  # fmt: skip
        """One estimate; `outputs` (numbers derived from the state) stand in it where the model has any.

        Args:
            resets, jump: how often the state was set anew, and what led from the estimate before the last time to
                the one after: whoever follows the estimate shifts by it when `resets` has grown by one.
            protection: levels of the protected states; null goes out where nothing limits the error.
            unobserved: guarded states that nothing teaches now, as the report has them; the message names them.
        """
        sound = math.isfinite(sum(x) + sum(std))
        message: Message = {
            "t": t_ns / 1e9, "t_ns": t_ns, "seq": seq, "epoch": epoch, "resets": resets,
            "jump": dict(zip(self._errors, jump, strict=True)) if resets else {},
            "state": dict(zip(self._names, x, strict=True)) if sound else {},
            "std": dict(zip(self._errors, std, strict=True)) if sound else {},
            "health": SERVICE_LABELS[service] if sound else INVALID,
            "unobserved": self._layout.named(unobserved),
        }  # fmt: skip
        if sound and outputs is not None:
            message["outputs"] = outputs
        if self._protected:
            message["protection"] = dict(zip(self._protected, protection, strict=True)) if sound else {}
        return message


class ControlMessage:
    """Commands of one layout."""

    def __init__(self, layout: Layout) -> None:
        self._names = [slot.name for slot in layout.controls]

    def content(
        self, t_ns: int, seq: int, epoch: int, u: Sequence[float], valid: bool, age_s: float, level: int
    ) -> Message:
        """One command.

        Args:
            u: what the actuator should do; where it is not finite: zeros, not valid.
            valid: whether it may be followed.
            age_s: from the last reading that corrected the state to the command.
            level: of the command (`control.levels.Level`); safe where the command is not finite.
        """
        sound = all(map(math.isfinite, u))
        values = u if sound else (0.0,) * len(u)
        return head(t_ns, seq, epoch) | {
            "u": dict(zip(self._names, values, strict=True)),
            "valid": valid and sound,
            "age_s": age_s,
            "level": LEVEL_LABELS[level if sound else Level.SAFE],
        }


def health_message(
    t_ns: int, seq: int, epoch: int, service: int, sensors: Mapping[str, int],
    faults: Mapping[str, FaultObject], model: bool, unobserved: Sequence[str],
) -> Message:  # fmt: skip
    """Health of the service and of every sensor, by name.

    Args:
        faults: what is wrong, of the sensors with which anything is.   model: whether the model is thought wrong.
        unobserved: guarded states that nothing teaches now, and which are therefore not learned.
    """
    labels = {name: HEALTH_LABELS[health] for name, health in sensors.items()}
    parts = {"service": SERVICE_LABELS[service], "sensors": labels, "faults": faults, "model": model}
    parts["unobserved"] = list(unobserved)
    return head(t_ns, seq, epoch) | parts


def event_message(
    t_ns: int, seq: int, epoch: int, sensor: str | None, before: str, after: str,
    fault: FaultObject | None = None, model: bool | None = None,
) -> Message:  # fmt: skip
    """One transition: from one health to another, or of what is wrong; `sensor` is null for the service's own.

    Args:
        fault: what is wrong with the sensor from now on (`recording.fault_words`), None where nothing is.
        model: of the service: whether the model, not a sensor, is thought wrong from now on; None: not said.
    """
    identity = {"id": f"{epoch}-{seq}", "sensor": sensor}
    own = {} if model is None else {"model": model}
    return head(t_ns, seq, epoch) | identity | {"from": before, "to": after, "fault": fault} | own


def reset_event(
    t_ns: int, seq: int, epoch: int, service: int, resets: int, jump: Mapping[str, float]
) -> Message:
    """The state was set to its initial value; the service's health beside it is that after the reset."""
    label = SERVICE_LABELS[service]
    return event_message(t_ns, seq, epoch, None, label, label) | {"reset": {"resets": resets, "jump": jump}}


def takeover_event(
    t_ns: int, seq: int, epoch: int, service: int, about: Mapping[str, Any], resets: int,
    jump: Mapping[str, float],
) -> Message:  # fmt: skip
    """Another daemon speaks from now on; `reset` as with any other where the estimate jumps with it.

    Args:
        service: its health, which a take-over does not change.   about: rank, cause, from whom.
    """
    label = SERVICE_LABELS[service]
    reset = {"reset": {"resets": resets, "jump": dict(jump)}} if jump else {}
    return event_message(t_ns, seq, epoch, None, label, label) | {"takeover": dict(about)} | reset


def report_message(report: Any, layout: Layout, seq: int, epoch: int) -> Message:
    """One report, every number by its field's name; what is not finite (an unlimited gate) is null."""
    sensor = layout.sensors[int(report["sensor"])]
    dof = int(report["dof"])
    vectors = {name: report[name][:dof].tolist() for name in ("nu", "S", "e", "R_used", "R_declared")}
    pairs = zip(vectors["R_used"], vectors["R_declared"], strict=True)
    vectors["R_ratio"] = [used / declared if declared > 0.0 else None for used, declared in pairs]
    return head(int(report["t_ns"]), seq, epoch) | vectors | {
        "sensor": sensor.name,
        "reading_seq": int(report["seq"]),
        "arrival_ns": int(report["arrival_ns"]),
        "verdict": Verdict(int(report["verdict"])).label,
        "action": Action(int(report["action"])).label,
        "z": report["z"][: int(report["length"])].tolist(),
        "nis": float(report["nis"]),
        "limit": float(report["limit"]),
        "health": HEALTH_LABELS[int(report["health"][sensor.number])],
        "fault": fault_object(layout, report, sensor.number),
        "service": SERVICE_LABELS[int(report["service"])],
    }  # fmt: skip


dumps = orjson.dumps
"""JSON that every reader accepts: NaN and Infinity become null."""
