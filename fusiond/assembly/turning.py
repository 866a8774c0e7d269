"""What turns with the heading, which sensors cannot tell, and which states are guarded because of it."""

from __future__ import annotations

import math

import numpy as np

from fusiond.assembly.plain import is_plain
from fusiond.assembly.resolve import Resolved, ResolvedSensor
from fusiond.assembly.trial import Array, Trial, irregular
from fusiond.errors import ConfigError
from fusiond.models.contract import Turning, by_name

TURNS_RAD = (0.7, 2.0, -1.9)
LOOKS = 4
"""States in which a sensor is tried."""
SAME = 1e-9
"""Relative change of a reading that is rounding."""


def places(resolved: Resolved) -> dict[str, int]:
    """Numbers of the error's slots by name."""
    return {slot.name: number for number, slot in enumerate(resolved.process.error_slots)}


def guarded_slots(resolved: Resolved) -> tuple[int, ...]:
    """Slots that are not learned while they cannot be observed; raises ConfigError for what cannot be guarded."""
    said, process = resolved.config.filter.guard_unobservable, resolved.process
    if said and (process.turning is None or is_plain(resolved.config)):
        why = (
            "the model knows no heading" if process.turning is None else "only the compiled step has a guard"
        )
        raise ConfigError(
            f"filter.guard_unobservable: {why}, the only thing through which states are guarded; leave it out"
        )
    if process.turning is None or is_plain(resolved.config):
        return ()
    names = process.turning.guarded if said is None else said
    for name in names:
        try:
            by_name(process.error_slots, name)
        except ConfigError as error:
            raise ConfigError(f"filter.guard_unobservable: {error}") from error
    return tuple(places(resolved)[name] for name in dict.fromkeys(names))


def turned(resolved: Resolved, turning: Turning, x: Array, angle_rad: float) -> Array:
    """The state x in a world turned by an angle about the vertical."""
    at, cosine, sine = places(resolved), math.cos(angle_rad), math.sin(angle_rad)
    dx = np.zeros(len(at))
    dx[at[turning.heading]] = angle_rad
    for first, second in turning.pairs:
        a, b = x[at[first]], x[at[second]]
        dx[at[first]], dx[at[second]] = cosine * a - sine * b - a, sine * a + cosine * b - b
    return Trial(resolved).shift(x, dx)


def is_free(resolved: Resolved, turning: Turning, sensor: ResolvedSensor) -> bool:
    """Whether no state shows this sensor which way the world is turned."""
    trial = Trial(resolved)
    n, model = len(resolved.process.error_slots), sensor.model
    wraps = np.array([slot.name in model.wraps for slot in model.channels[: model.dof]])
    for look in range(LOOKS):
        x = trial.shift(trial.start(), irregular(n, look))
        z = trial.look(sensor, x, look)[0]
        for angle_rad in TURNS_RAD:
            change = trial.look(sensor, turned(resolved, turning, x, angle_rad), look)[0] - z
            change = np.where(wraps, (change + np.pi) % (2.0 * np.pi) - np.pi, change)
            if not np.all(np.abs(change) <= SAME * (1.0 + np.abs(z))):
                return False
    return True


def fill_turning(resolved: Resolved, record: np.record) -> None:
    """Write the design's heading, turns_to, turns_by, free and guarded."""
    turning = resolved.process.turning
    record["turns_to"] = -1
    if turning is None:
        return
    at = places(resolved)
    record["heading"] = at[turning.heading]
    for first, second in turning.pairs:
        a, b = at[first], at[second]
        record["turns_to"][a], record["turns_to"][b] = b, a
        record["turns_by"][a], record["turns_by"][b] = 1.0, -1.0
    for number, sensor in enumerate(resolved.sensors):
        record["free"][number] = sensor.module is not None and is_free(resolved, turning, sensor)
    slots = guarded_slots(resolved)
    record["guarded"][: len(slots)] = slots
