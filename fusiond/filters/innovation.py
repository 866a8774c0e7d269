"""What one sensor says about the state, linearised at the prior mean: the argument of every update."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Innovation:
    """z = h(x) + v, v ~ N(0, R), seen from the prior mean.

    Args:
        nu: (m,) z - h(x).   H: (m, n) dh/dx.   R: (m, m), positive semi-definite.
    """

    nu: Vector
    H: Matrix
    R: Matrix


def right_divide(numerator: Matrix, S: Matrix) -> Matrix:
    """numerator S^-1 for a symmetric S, by a solver, never by an inverse; its pseudo-inverse where S is singular.

    Args:
        numerator: (k, m).   S: (m, m).
    """
    try:
        return np.asarray(np.linalg.solve(S, numerator.T).T, dtype=np.float64)
    except np.linalg.LinAlgError:
        return np.asarray(numerator @ np.linalg.pinv(S, hermitian=True))
