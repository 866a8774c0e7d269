"""What `fusiond check` says of the control loop: gains, poles, disk margins, expected cost of every set of sensors."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from fusiond.assembly.expected_cost import SAME_S, expected_costs
from fusiond.assembly.resolve import Resolved
from fusiond.assembly.settled import Mover, events_of, settled_at_begin
from fusiond.control.margins import DiskMargin, Loop, disk_margin, estimated_loop, regulator_loop
from fusiond.control.plant import Plan
from fusiond.numerics.riccati import Matrix


def margins_of(resolved: Resolved) -> dict[str, Any]:
    """Ready for JSON; empty without a law that was designed from plant and cost.

    `regulator` is the loop that is told the state. `with_estimate` has the filter in it: only where the command drives
    the prediction and all sensors read once a command; else null.
    """
    law = resolved.law
    if law is None or law.plan is None or resolved.config.control is None:
        return {}
    plan = law.plan
    loop = _with_filter(resolved, plan)
    return {
        "law": str(getattr(resolved.config.control, "law", "")),
        "period_s": plan.plant.period_s,
        "delay_periods": plan.plant.queue,
        "gain": np.hstack([plan.K, plan.L]).tolist(),
        "regulator": _told(regulator_loop(plan)),
        "with_estimate": None if loop is None else _told(loop),
        "expected_cost": [
            {"working": sorted(one.working), "cost": one.cost} for one in expected_costs(resolved)
        ],
    }


def _told(loop: Loop) -> dict[str, Any]:
    margin: DiskMargin = disk_margin(loop)
    return {
        "poles": poles_of(loop.poles),
        "disk_margin": margin.alpha,
        "gain_margin": list(margin.gain),
        "phase_margin_rad": margin.phase_rad,
    }


def poles_of(poles: NDArray[np.complex128]) -> list[list[float]]:
    """[real, imaginary], the slowest first."""
    ordered = sorted(poles.tolist(), key=lambda pole: (-abs(pole), pole.imag))
    return [[pole.real, pole.imag] for pole in ordered]


def _with_filter(resolved: Resolved, plan: Plan) -> Loop | None:
    """The loop with the settled filter in it, None where it has not one rate."""
    if not (resolved.law and resolved.law.drives) or not resolved.process.linear or plan.disturbances:
        return None
    events, period_s = events_of(resolved)
    at_once = all(event.t_s < SAME_S for event in events)
    if (
        not at_once
        or abs(period_s - plan.plant.period_s) > SAME_S
        or len(plan.states) < len(resolved.process.states)
    ):
        return None
    P = settled_at_begin(events, period_s, Mover(resolved), len(resolved.process.states))
    if P is None:
        return None
    H: Matrix = np.vstack([event.H for event in events])
    R: Matrix = block_diag(*(event.R for event in events))
    S = H @ P @ H.T + R
    gain: Matrix = np.asarray(np.linalg.solve(S, H @ P).T, dtype=np.float64)
    return estimated_loop(plan, H, gain)
