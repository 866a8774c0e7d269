"""What must hold whatever happens, and what is counted.

Laws, of which a single breach fails the study: every number that comes out is one; every reading has one verdict with
a name; the same readings in other portions give the same bits.

Counted: whether every sensor is well again at the end of the run, whether somebody was named who never lied, and
whether the estimate that calls itself nominal at the end is where it says it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.simulation.tables import Simulation
from fusiond.types import Health, ServiceHealth, Verdict

FAR = 6.0
"""Deviations from the truth that an honest estimate does not have."""
NAMED = (Health.FAULTY, Health.EXCLUDED)


@dataclass(frozen=True, slots=True)
class Findings:
    """What one run showed.

    broken: laws it broke.   ill: sensors that are not well at the end.   slandered: who was named and never lied.
    astray: states further off than the estimate admits, at its end.
    """

    broken: tuple[str, ...]
    ill: tuple[str, ...]
    slandered: tuple[str, ...]
    astray: tuple[str, ...]


def broken_laws(reports: NDArray[Any], given: int, digest: str, again: str) -> tuple[str, ...]:
    """The laws that a run breaks.

    Args:
        reports: of `layout.report`, one for each of the `given` readings.
        digest, again: of all reports of the run, and of its repetition in other portions.
    """
    broken = []
    live = reports[reports["service"] != ServiceHealth.INVALID]
    if not (np.isfinite(live["x"]).all() and np.isfinite(live["std"]).all()):
        broken.append("a number that is none in an estimate")
    if len(reports) != given or not set(np.unique(reports["verdict"]).tolist()) <= set(Verdict):
        broken.append("a reading without a verdict")
    if digest != again:
        broken.append("other bits for the same readings")
    return tuple(broken)


def ill_at_the_end(layout: Layout, reports: NDArray[Any]) -> tuple[str, ...]:
    """Sensors that are not healthy in the last report, with what is said of them."""
    health = [Health(int(value)) for value in reports["health"][-1]]
    return tuple(f"{s.name} {health[s.number].label}" for s in layout.sensors if health[s.number])


def slandered(layout: Layout, reports: NDArray[Any], liars: set[str]) -> tuple[str, ...]:
    """Who was called faulty or excluded and never lied."""
    named = {int(k) for k in np.flatnonzero(np.isin(reports["health"], NAMED).any(axis=0))}
    return tuple(s.name for s in layout.sensors if s.number in named and s.name not in liars)


def astray(layout: Layout, reports: NDArray[Any], simulation: Simulation) -> tuple[str, ...]:
    """States that are further from the truth than FAR of their own deviations in the last report, if it is nominal."""
    last, truth = reports[-1], simulation.truth
    if last["service"] != ServiceHealth.NOMINAL:
        return ()
    found = []
    for column, (state, error) in enumerate(zip(layout.states, layout.errors, strict=False)):
        if state.name in truth.names and state.name == error.name:
            off = last["x"][column] - np.interp(last["state_t_ns"], truth.t_ns, truth.column(state.name))
            if state.unit == "rad":
                off = (off + np.pi) % (2.0 * np.pi) - np.pi
            if abs(off) > FAR * last["std"][column]:
                found.append(f"{state.name} off by {abs(off) / last['std'][column]:.0f} sigma")
    return tuple(found)
