"""What a configuration's control should cost on average, for every set of working sensors.

A command is computed from the filter settled on the sensors that work, at the moment of the command: of readings that
bear its very stamp it knows the first, which made it due, and all it waits for (`control.waits_for`). Only where the
model is linear and time-invariant, and so its covariance is known beforehand; inputs are taken to work.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from fusiond.assembly.course import rate_hz
from fusiond.assembly.resolve import Resolved
from fusiond.assembly.settled import Event, Mover, corrected, events_of, settled_at_begin
from fusiond.control.cost import expected_cost
from fusiond.numerics.riccati import Matrix
from fusiond.types import Role

MOST = 6
"""Sensors up to which every set is looked at; with more of them only what is left without any one."""
SAME_S = 1e-9
"""Moments no further apart are one."""


@dataclass(frozen=True, slots=True)
class Expected:
    """The cost of one set of working sensors, per second; None where it has no limit."""

    working: frozenset[str]
    cost: float | None


def sets_of(names: list[str]) -> list[frozenset[str]]:
    """Sets of working sensors, the whole one first."""
    if len(names) > MOST:
        return [frozenset(names), *(frozenset(names) - {name} for name in names)]
    return [frozenset(one) for k in range(len(names), -1, -1) for one in combinations(names, k)]


def expected_costs(resolved: Resolved) -> list[Expected]:
    """For every set of working sensors; empty without a designed law, or where covariances depend on the motion."""
    law = resolved.law
    if law is None or law.plan is None or not resolved.process.linear or resolved.process.errors:
        return []
    at = [[slot.name for slot in resolved.process.states].index(name) for name in law.plan.states]
    found = []
    for working in sets_of([sensor.name for sensor in resolved.updating]):
        P = covariance_at_commands(only(resolved, working))
        found.append(Expected(working, None if P is None else expected_cost(law.plan, P[np.ix_(at, at)])))
    return found


def only(resolved: Resolved, working: Iterable[str]) -> Resolved:
    """The configuration with these of its updating sensors."""
    kept = (s for s in resolved.sensors if s.role is not Role.UPDATE or s.name in working)
    return replace(resolved, sensors=tuple(kept))


def covariance_at_commands(resolved: Resolved) -> Matrix | None:
    """(n, n) mean covariance of the estimate when commands are computed; None where it never settles."""
    section = resolved.config.control
    assert section is not None
    events, period_s = events_of(resolved)
    mover = Mover(resolved)
    P = settled_at_begin(events, period_s, mover, len(resolved.process.states))
    if P is None:
        return None
    commands = max(1, round(period_s * section.rate_hz))
    total, now_s, left = np.zeros_like(P), 0.0, list(events)
    for turn in range(commands):
        due_s = turn * period_s / commands
        while left and left[0].t_s < due_s - SAME_S:
            event = left.pop(0)
            P, now_s = corrected(_moved(mover, P, event.t_s - now_s), event), event.t_s
        P, now_s = _moved(mover, P, due_s - now_s), due_s
        known = P
        for event in _known_by(resolved, left, due_s):
            known = corrected(known, event)
        total += known
    return np.asarray(total / commands)


def _moved(mover: Mover, P: Matrix, dt_s: float) -> Matrix:
    F, Q = mover.over(dt_s)
    return np.asarray(F @ P @ F.T + Q)


def _known_by(resolved: Resolved, left: list[Event], due_s: float) -> list[Event]:
    """Of the readings of a command's own moment, those that are used before it is computed."""
    section = resolved.config.control
    assert section is not None
    same = [event for event in left if event.t_s < due_s + SAME_S]
    names = [resolved.sensors[event.sensor].name for event in same]
    awaited = [place for place, name in enumerate(names) if name in section.waits_for]
    if awaited:
        return same[: awaited[-1] + 1]
    return [] if _some_input_reads(resolved) else same[:1]


def _some_input_reads(resolved: Resolved) -> bool:
    """Whether an input reads at the moment of a command, and so makes it due before any sensor corrects the state."""
    section = resolved.config.control
    assert section is not None
    inputs = [s for s in resolved.sensors if s.role is Role.INPUT and s.section is not None]
    return any(rate_hz(resolved, sensor) >= section.rate_hz for sensor in inputs)
