"""One interval of a linear, time-invariant model on a whole covariance. `assembly` copies this file as `advance.py`."""

from __future__ import annotations

from typing import Any

from fusiond.engine.step.advance import discretised

from .spread import spread


def advance(track: Any, design: Any, work: Any, row: int, dt_ns: int) -> None:
    """Predict filter `row` over one interval. Reads track.u, u_var; writes its x, P (not its time)."""
    slot = discretised(design, work, dt_ns)
    F, B, G = work.cache_F[slot], work.cache_B[slot], work.cache_G[slot]
    track.x[row] = F @ track.x[row] + B @ track.u + work.cache_c[slot]
    spread(track, design, row, F, G, work.cache_q[slot], B)
