"""The covariance of any linear correction, optimal or not: P+ = (I - M H) P (I - M H)' + M R M'.

Positive semi-definite by construction, up to rounding. With the gain of Model 1 it is a filter of its own; with any
other gain it is the honest covariance of what that gain does.
Source: Bucy & Joseph 1968; Grewal & Andrews 2015, section 7.4.
"""

from __future__ import annotations

import numpy as np

from fusiond.filters.conventional import gain
from fusiond.filters.innovation import Innovation, Matrix, Vector


def covariance(P: Matrix, M: Matrix, seen: Innovation) -> Matrix:
    """(n, n) covariance after x + M nu, symmetric."""
    kept = np.eye(P.shape[0]) - M @ seen.H
    after = kept @ P @ kept.T + M @ seen.R @ M.T
    return np.asarray(0.5 * (after + after.T))


def update(x: Vector, P: Matrix, seen: Innovation) -> tuple[Vector, Matrix]:
    """Condition N(x, P) on the innovation."""
    M = gain(P, seen)
    return x + M @ seen.nu, covariance(P, M, seen)
