"""What `status` and `config` answer."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any

from fusiond import __version__
from fusiond.engine.layout import SensorLayout
from fusiond.recording.description import describe
from fusiond.service.counters import Counters
from fusiond.service.health_watch import HealthWatch
from fusiond.service.mailbox import Mailbox
from fusiond.service.messages import HEALTH_LABELS, SERVICE_LABELS
from fusiond.service.wire import Decoder
from fusiond.types import Health, Role


def sensors_status(
    counters: Counters, decoder: Decoder, watch: HealthWatch, noise: Mapping[str, Any]
) -> dict[str, Any]:
    """Counts, health and fault of every sensor, by name. `refused`: what came for it and was no reading, by reason.

    `heard`: whether any reading of it ever came. One that the state needs and nobody heard is silent, whatever the
    estimator, which judges by the age of readings, still thinks of it. `noise`: R used and slow R over the declared
    one, by channel; null where it is as declared.
    """
    return {
        sensor.name: {
            "health": _health(sensor, counters, watch),
            "heard": counters.heard(sensor.number),
            "fault": watch.faults[sensor.number],
            "noise": noise.get(sensor.name),
            **counters.of_sensor(sensor.number),
            "refused": decoder.refused_by_sensor[sensor.number],
        }
        for sensor in counters.layout.sensors
    }


def _health(sensor: SensorLayout, counters: Counters, watch: HealthWatch) -> str:
    needed = sensor.role in {Role.UPDATE, Role.INPUT}
    known = HEALTH_LABELS[watch.sensors[sensor.number]]
    return Health.SILENT.label if needed and not counters.heard(sensor.number) else known


def status(
    *, config: Any, mode: str, endpoints: tuple[str, ...], epoch: int, uptime_s: float, resets: int,
    counters: Counters, decoder: Decoder, watch: HealthWatch, mailbox: Mailbox, latest: Any,
    parity: dict[str, Any], repairs: int, guard: dict[str, float], state_sha256: str, recorder: Any,
    control: dict[str, Any], noise: Mapping[str, Any],
) -> dict[str, Any]:  # fmt: skip
    """The daemon's account of itself.

    Args:
        noise: what was learnt of it (`engine.noise_learnt`).
        repairs, guard: what the guard of the covariance did and met (`Engine.guard`; empty where none is needed).
        control: level of the last command (null before the first), commands so far, deadlines the loop missed, cost.
    """
    recording = None if recorder is None else {"dropped": dict(recorder.dropped), "error": recorder.error}
    return {
        "version": __version__,
        "name": config.name,
        "namespace": config.prefix,
        "pid": os.getpid(),
        "mode": mode,
        "endpoints": list(endpoints),
        "epoch": epoch,
        "uptime_s": round(uptime_s, 3),
        "service": SERVICE_LABELS[watch.service],
        "model": {"alarm": watch.model},
        "resets": resets,
        "readings": counters.readings,
        "ticks": counters.ticks,
        "sensors": sensors_status(counters, decoder, watch, noise),
        "refused": decoder.refusals.by_name(),
        "queue": {"waiting": len(mailbox), "capacity": mailbox.capacity, "dropped": mailbox.dropped},
        "estimate": latest,
        "parity": parity,
        "repairs": repairs,
        "guard": guard,
        "state_sha256": state_sha256,
        "recording": recording,
        "control": control,
    }


def configuration(config: Any, layout: Any) -> dict[str, Any]:
    """The configuration with every default written out, and names and units of every number in its records."""
    return {"config": config.model_dump(mode="json"), "layout": json.loads(describe(layout))}
