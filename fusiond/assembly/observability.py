"""Which states the sensors can see, all together and each left out, along a trial motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusiond.assembly.resolve import Resolved, ResolvedSensor
from fusiond.assembly.trial import Array, Trial, irregular
from fusiond.errors import ConfigError
from fusiond.models.contract import by_name
from fusiond.numerics.observability import blind_share

UNSEEN = 1e-6
"""Part of a unit vector in the null space from which a state counts as unobserved."""


@dataclass(frozen=True, slots=True)
class Observability:
    """What a set of sensors can see.

    Args:
        rank: dimensions observed, of `states`.   unobserved: names of the states not fully seen.
    """

    states: int
    rank: int
    unobserved: tuple[str, ...]


def trial_interval_s(resolved: Resolved) -> float:
    """Time between two looks: the model's own step, or the longest period among the updating sensors."""
    if resolved.process.step_s > 0.0:
        return resolved.process.step_s
    rates = [
        sensor.section.rate_hz for sensor in resolved.updating if sensor.section and sensor.section.rate_hz
    ]
    return 1.0 / min(rates) if rates else 0.1


def observability(resolved: Resolved, sensors: tuple[ResolvedSensor, ...]) -> Observability:
    """What these sensors see over a trial motion of three looks a state, with irregular inputs and disturbances."""
    trial = Trial(resolved)
    states = resolved.process.error_slots
    n, dt_s = len(states), trial_interval_s(resolved)
    x, passed = trial.start(), np.eye(n)
    rows: list[Array] = [np.zeros((1, n))]
    for look in range(3 * n):
        for sensor in sensors:
            rows.append(trial.look(sensor, x, look)[1] @ passed)
        x, F, _ = trial.move(x, irregular(len(resolved.process.inputs), look), dt_s)
        x = x if resolved.process.linear else trial.shift(x, 0.3 * (irregular(n, look) - 1.0))
        passed = F @ passed
    rank, blind = blind_share(np.vstack(rows))
    unobserved = tuple(slot.name for slot, part in zip(states, blind, strict=True) if part > UNSEEN)
    return Observability(n, rank, unobserved)


def require_observable(resolved: Resolved) -> None:
    """Raise ConfigError for a state that all sensors together do not see, unless it is accepted."""
    accepted = set(resolved.config.filter.accept_unobservable)
    for name in accepted:
        try:
            by_name(resolved.process.error_slots, name)
        except ConfigError as error:
            raise ConfigError(f"filter.accept_unobservable: {error}") from error
    seen = observability(resolved, resolved.updating)
    missing = [name for name in seen.unobserved if name not in accepted]
    if missing:
        names = ", ".join(missing)
        raise ConfigError(
            f"sensor: nothing observes {names} (rank {seen.rank} of {seen.states}); add a sensor that does, or list "
            f"what may stay unknown under filter.accept_unobservable"
        )


def bears_a_filter(resolved: Resolved, sensor: ResolvedSensor) -> bool:
    """Whether one sensor alone sees every state that must be seen."""
    alone = observability(resolved, (sensor,))
    return set(alone.unobserved) <= set(resolved.config.filter.accept_unobservable)


def without_each(resolved: Resolved) -> dict[str, Observability]:
    """What is still seen when each updating sensor is left out, by its name."""
    return {
        sensor.name: observability(
            resolved, tuple(other for other in resolved.updating if other is not sensor)
        )
        for sensor in resolved.updating
    }
