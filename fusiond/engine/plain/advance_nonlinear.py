"""One interval of a nonlinear model on a whole covariance. `assembly` copies this file as `advance.py`."""

from __future__ import annotations

from typing import Any

from fusiond.engine.step.process import (  # type: ignore[attr-defined] # the template's model is linear
    noise,
    transition,
)

from .spread import spread


def advance(track: Any, design: Any, work: Any, row: int, dt_ns: int) -> None:
    """Predict filter `row` over one interval. Reads track.u, u_var; writes its x, P (not its time)."""
    for matrix in (work.F, work.B, work.G):
        matrix[:] = 0.0
    dt_s = dt_ns * 1e-9
    transition(track.x[row], track.u, dt_s, design.p, work.x, work.F, work.B)
    noise(track.x[row], dt_s, design.p, work.G, work.q)
    track.x[row] = work.x
    spread(track, design, row, work.F, work.G, work.q, work.B)
