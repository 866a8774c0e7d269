"""Full-rate decentralized fusion: every local filter sends what its last reading told it; the centre adds it up.

    sent by i:   Y_i = P_i(+)^-1 - P_i(-)^-1,   y_i = P_i(+)^-1 x_i(+) - P_i(-)^-1 x_i(-)
    centre:      P(+)^-1 = P(-)^-1 + sum Y_i,   P(+)^-1 x(+) = P(-)^-1 x(-) + sum y_i

Each filter predicts with the whole Q. Since Y_i = C_i' R_i^-1 C_i whatever the local prior, the centre is the
centralized filter as long as everything is sent at every step.
Source: Rao & Durrant-Whyte 1991. Law: tests/laws/test_fusion_exact.py.
"""

from __future__ import annotations

import numpy as np

from fusiond.filters import information
from fusiond.filters.innovation import Innovation, Matrix, Vector


def difference(prior: tuple[Vector, Matrix], posterior: tuple[Vector, Matrix]) -> tuple[Vector, Matrix]:
    """y_i (n,) and Y_i (n, n) from the local estimates before and after, both covariances regular.

    Raises:
        numpy.linalg.LinAlgError: a singular covariance; `absorb` needs none.
    """
    (x_before, P_before), (x_after, P_after) = prior, posterior
    Y_before, Y_after = np.linalg.inv(P_before), np.linalg.inv(P_after)
    return Y_after @ x_after - Y_before @ x_before, Y_after - Y_before


def absorb(x: Vector, P: Matrix, x_local: Vector, seen: Innovation) -> tuple[Vector, Matrix]:
    """The centre after one local filter's contribution, computed from its reading: no covariance is inverted.

    Args:
        x, P: the centre's prior.   x_local: (n,) the mean at which `seen` was taken, the local filter's prior.
    """
    return information.update(x, P, Innovation(seen.nu + seen.H @ (x_local - x), seen.H, seen.R))
