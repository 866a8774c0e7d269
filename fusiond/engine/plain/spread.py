"""What an interval does to a covariance: P <- F P F' + (G diag(q) G' + B diag(u_var) B') / share."""

from __future__ import annotations

from typing import Any

from fusiond.filters.conventional import predict
from fusiond.filters.innovation import Matrix, Vector


def spread(track: Any, design: Any, row: int, F: Matrix, G: Matrix, q: Vector, B: Matrix) -> None:
    """Predict the covariance of one row, and of row 0 the honest one too. Reads track.u_var, design.share."""
    Q = (G * q) @ G.T + (B * track.u_var) @ B.T
    P = predict(track.P[row], F, Q / design.share[row])
    track.P[row] = 0.5 * (P + P.T)
    if row == 0:
        track.honest[:] = predict(track.honest, F, Q)
