"""The UD recursion on dense covariances: factor, Bierman's update channel by channel, compose. Plain Python.

The engine's own recursion keeps the factors in its record and runs compiled (`fusiond.engine.step`); this one lets
the same kernels stand behind a topology that works on whole covariances.
"""

from __future__ import annotations

import numpy as np

from fusiond.filters import joseph
from fusiond.filters.innovation import Innovation, Matrix, Vector
from fusiond.numerics.kernel import interpreted
from fusiond.numerics.ud import bierman_update, ud_compose, ud_factor, whiten

ROUNDING = 1e-9
"""A pivot this far below zero, relative to the largest variance, is rounding."""


def update(x: Vector, P: Matrix, seen: Innovation) -> tuple[Vector, Matrix]:
    """Condition N(x, P) on the innovation; a P that has no factors at all falls back to the Joseph form."""
    n, m = x.shape[0], seen.nu.shape[0]
    U, d, R_U, R_d = np.eye(n), np.zeros(n), np.eye(m), np.zeros(m)
    factored = interpreted(ud_factor)(P.copy(), U, d, ROUNDING)
    if not (factored and interpreted(ud_factor)(seen.R.copy(), R_U, R_d, ROUNDING)):
        return joseph.update(x, P, seen)
    nu, H = seen.nu.copy(), seen.H.copy()
    interpreted(whiten)(R_U, nu, H, m)
    after, a, b = x.copy(), np.zeros(n), np.zeros(n)
    for i in range(m):
        left = float(nu[i] - H[i] @ (after - x))
        interpreted(bierman_update)(after, U, d, H[i], float(R_d[i]), left, a, b)
    composed = np.zeros((n, n))
    interpreted(ud_compose)(U, d, composed)
    return after, composed
