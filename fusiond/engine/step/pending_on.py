"""The mean goes with every input, the covariance follows more rarely, and loses nothing by it.

A covariance does not act on the mean while nothing is measured. So the transitions of the intervals since it was last
brought forward are multiplied, and their noises carried along,

    Phi <- F Phi,   Q <- F Q F' + G diag(q) G' + B diag(u_var) B',

and U, d are brought forward once for all of them, P <- Phi P Phi' + Q, before a correction or a tick reads them,
and when a multiple of design.covariance_ns has passed, so that no product grows long. It is the full-rate covariance to
rounding, of any model. When it is due depends on the filter's own readings alone, so that leaving a sensor out stays
never having had it. The report on an input's reading has the deviations of the last time.
Law: tests/laws/test_covariance_rate.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.numerics.arrays import copy_matrix
from fusiond.numerics.discretise import multiply
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import thornton_predict, ud_compose, ud_factor

from .sizes import ERRORS, INPUTS, NOISES


@kernel
def nothing_pending(track: Any, row: int) -> None:
    """Filter `row` begins."""
    track.pending[row] = 0


@kernel
def carry_rows(F: Any, A: Any, C: Any) -> None:
    """C = F A = A + (F - I) A, zeros of F - I left out: an interval's transition is nearly the identity."""
    for i in range(ERRORS):
        for k in range(ERRORS):
            C[i, k] = A[i, k]
        for m in range(ERRORS):
            f = F[i, m] - 1.0 if i == m else F[i, m]
            if f != 0.0:
                for k in range(ERRORS):
                    C[i, k] += f * A[m, k]


@kernel
def carry_noise(F: Any, Q: Any, work: Any) -> None:
    """Q <- F Q F', its lower triangle alone; uses work.T, T2."""
    carry_rows(F, Q, work.T)
    for i in range(ERRORS):
        for k in range(ERRORS):
            work.T2[k, i] = work.T[i, k]
    for i in range(ERRORS):
        for k in range(i + 1):
            Q[i, k] = work.T2[i, k]
        for m in range(ERRORS):
            f = F[i, m] - 1.0 if i == m else F[i, m]
            if f != 0.0:
                for k in range(i + 1):
                    Q[i, k] += f * work.T2[m, k]


@kernel
def add_noise(Q: Any, work: Any) -> None:
    """Q <- Q + W_Q diag(w_d) W_Q', columns as `advance` leaves them in work.W, w_d; lower triangle, then mirrored."""
    for c in range(ERRORS, ERRORS + NOISES + INPUTS):
        for i in range(ERRORS):
            weighted = work.w_d[c] * work.W[c, i]
            if weighted != 0.0:
                for k in range(i + 1):
                    Q[i, k] += weighted * work.W[c, k]
    for i in range(ERRORS):
        for k in range(i):
            Q[k, i] = Q[i, k]


@kernel
def spread(track: Any, work: Any, row: int) -> None:
    """Add the interval of work.F, W, w_d to what is pending of filter `row`."""
    F, Q = track.pending_F[row], track.pending_Q[row]
    if track.pending[row] == 0:
        copy_matrix(work.F, F)
        Q[:] = 0.0
    else:
        carry_rows(work.F, F, work.T)
        copy_matrix(work.T, F)
        carry_noise(work.F, Q, work)
    add_noise(Q, work)
    track.pending[row] += 1


@kernel
def settle_pending(track: Any, work: Any, row: int) -> None:
    """Bring U, d of filter `row` to its time."""
    if track.pending[row] == 0:
        return
    track.pending[row] = 0
    copy_matrix(track.pending_Q[row], work.T)
    # Positive semi-definite as a sum of squares: what is negative is rounding.
    ud_factor(work.T, work.T2, work.T_d, 1.0)
    for j in range(ERRORS):
        work.settle_d[ERRORS + j] = work.T_d[j]
        for i in range(ERRORS):
            work.settle_W[ERRORS + j, i] = work.T2[i, j] if i <= j else 0.0
    thornton_predict(track.U[row], track.d[row], track.pending_F[row], work.settle_W, work.settle_d, work.a)


@kernel
def settle_when_due(track: Any, design: Any, work: Any, row: int, before_ns: int) -> None:
    """Bring U, d of filter `row` to its time if that is due; it came from before_ns."""
    period_ns = design.covariance_ns
    if track.filter_t_ns[row] // period_ns != before_ns // period_ns:
        settle_pending(track, work, row)


@kernel
def keep_pending(track: Any, work: Any, row: int) -> None:
    """Copy aside what is pending."""
    work.kept_pending = track.pending[row]
    copy_matrix(track.pending_F[row], work.kept_F)
    copy_matrix(track.pending_Q[row], work.kept_Q)


@kernel
def put_back_pending(track: Any, work: Any, row: int) -> None:
    """Undo what happened to it since."""
    track.pending[row] = work.kept_pending
    copy_matrix(work.kept_F, track.pending_F[row])
    copy_matrix(work.kept_Q, track.pending_Q[row])


@kernel
def compose(track: Any, P: Any) -> None:
    """Write the covariance of the centralized filter at its time."""
    ud_compose(track.U[0], track.d[0], P)
    if track.pending[0] == 0:
        return
    F = track.pending_F[0]
    carried = np.zeros((ERRORS, ERRORS))
    multiply(1.0, F, P, carried)
    for i in range(ERRORS):
        for j in range(ERRORS):
            P[i, j] = track.pending_Q[0, i, j]
            for k in range(ERRORS):
                P[i, j] += carried[i, k] * F[j, k]
