"""Seed 004, Model 1 (Table 2-1): the conventional Kalman filter, P(n|n) = [I - M C] P(n|n-1) as printed.

Nothing here keeps P positive semi-definite: with a precise sensor and a wide prior it loses definiteness to rounding
(`fusiond.numerics.covariance` watches it).
"""

from __future__ import annotations

import numpy as np

from fusiond.filters.innovation import Innovation, Matrix, Vector, right_divide


def predict(P: Matrix, F: Matrix, Q: Matrix) -> Matrix:
    """P(n+1|n) = A P(n|n) A' + Q (2-11, 3-10, 5-10); Q (n, n) is B Q B' there, the noise entering with the input."""
    return np.asarray(F @ P @ F.T + Q)


def gain(P: Matrix, seen: Innovation) -> Matrix:
    """(n, m) M = P C' S^-1, S = C P C' + R (2-4)."""
    cross = P @ seen.H.T
    return right_divide(cross, seen.H @ cross + seen.R)


def update(x: Vector, P: Matrix, seen: Innovation) -> tuple[Vector, Matrix]:
    """x(n|n) = x + M r (2-6) and P(n|n) = [I - M C] P (2-7).

    Law: tests/laws/test_filters_equal.py::test_all_recursions_are_one_filter.
    """
    M = gain(P, seen)
    return x + M @ seen.nu, np.asarray(P - M @ (seen.H @ P))
