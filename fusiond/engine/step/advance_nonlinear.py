"""One interval of a nonlinear model, linearised at the prior mean. `assembly` copies this file over `advance.py`."""

from __future__ import annotations

from typing import Any

from fusiond.numerics.arrays import copy_vector
from fusiond.numerics.kernel import kernel

from .monitor import carry
from .pending import spread
from .process import noise, transition
from .sizes import ERRORS, INPUTS, NOISES


@kernel
def advance(track: Any, design: Any, work: Any, row: int, dt_ns: int) -> None:
    """Predict filter `row` over one interval. Reads track.u, u_var; writes its x, and U, d or what is pending."""
    x = track.x[row]
    work.F[:] = 0.0
    work.B[:] = 0.0
    work.G[:] = 0.0
    dt_s = dt_ns * 1e-9
    transition(x, track.u, dt_s, design.p, work.x, work.F, work.B)
    noise(x, dt_s, design.p, work.G, work.q)
    copy_vector(work.x, x)
    for j in range(NOISES):
        work.w_d[ERRORS + j] = work.q[j]
        for i in range(ERRORS):
            work.W[ERRORS + j, i] = work.G[i, j]
    for j in range(INPUTS):
        work.w_d[ERRORS + NOISES + j] = track.u_var[j]
        for i in range(ERRORS):
            work.W[ERRORS + NOISES + j, i] = work.B[i, j]
    carry(track, work, row, work.F, work.B)
    spread(track, work, row)
