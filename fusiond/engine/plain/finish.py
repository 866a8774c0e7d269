"""The end of a plain step: the state; health and command are the compiled step's own."""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.engine.step.finish import describe_faults, describe_resets, judge_health
from fusiond.engine.step.sizes import CONTROLS
from fusiond.engine.step.steer import steer


def describe_state(track: Any, report: Any) -> bool:
    """Write x and std of row 0; False where they are not finite, or a variance is negative."""
    report.x[:] = track.x[0]
    report["std"][:] = np.sqrt(np.diagonal(track.P[0]))
    report.state_t_ns = track.filter_t_ns[0]
    return bool(np.isfinite(report.x).all() and np.isfinite(report["std"]).all())


def finish(track: Any, desk: Any, design: Any, now_ns: int, report: Any) -> None:
    """Complete the report of one reading or tick."""
    finite = describe_state(track, report)
    describe_resets(track, report)
    judge_health(track, desk, design, now_ns, finite, report)
    describe_faults(track, design, report)
    if CONTROLS > 0 and track.started:
        steer(track, desk, design, now_ns, report)
