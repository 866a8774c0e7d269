"""One interval of a linear, time-invariant model."""

from __future__ import annotations

from typing import Any

from fusiond.engine.records import CACHE
from fusiond.numerics.arrays import copy_vector
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import LARGEST_STATE, thornton_predict

from .monitor import carry
from .process import discretise
from .sizes import ERRORS, INPUTS, NOISES, STATES


@kernel
def discretised(design: Any, work: Any, dt_ns: int) -> int:
    """Place in the cache of F, B, c, G, q for this interval, filled when it is new."""
    slot = (dt_ns * 2654435761 >> 8) % CACHE
    if work.cache_dt_ns[slot] != dt_ns:
        work.cache_F[slot][:] = 0.0
        work.cache_B[slot][:] = 0.0
        work.cache_c[slot][:] = 0.0
        work.cache_G[slot][:] = 0.0
        discretise(
            dt_ns * 1e-9,
            design.p,
            work.cache_F[slot],
            work.cache_B[slot],
            work.cache_c[slot],
            work.cache_G[slot],
            work.cache_q[slot],
        )
        work.cache_dt_ns[slot] = dt_ns
    return slot


@kernel
def advance(track: Any, design: Any, work: Any, row: int, dt_ns: int) -> None:
    """Predict filter `row` over one interval. Reads track.u, u_var; writes its x, U, d (not its time)."""
    slot = discretised(design, work, dt_ns)
    F, B, G = work.cache_F[slot], work.cache_B[slot], work.cache_G[slot]
    x = track.x[row]
    for i in range(STATES):
        total = work.cache_c[slot, i]
        for j in range(STATES):
            total += F[i, j] * x[j]
        for j in range(INPUTS):
            total += B[i, j] * track.u[j]
        work.x[i] = min(max(total, -LARGEST_STATE), LARGEST_STATE)
    copy_vector(work.x, x)
    for j in range(NOISES):
        work.w_d[ERRORS + j] = work.cache_q[slot, j]
        for i in range(ERRORS):
            work.W[ERRORS + j, i] = G[i, j]
    for j in range(INPUTS):
        work.w_d[ERRORS + NOISES + j] = track.u_var[j]
        for i in range(ERRORS):
            work.W[ERRORS + NOISES + j, i] = B[i, j]
    carry(track, work, row, F, B)
    thornton_predict(track.U[row], track.d[row], F, work.W, work.w_d, work.a)
