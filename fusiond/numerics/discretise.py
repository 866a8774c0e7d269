"""From continuous time to one interval: the exact transition and noise of a linear model, and angles on the circle.

Written in loops: numba needs seconds to compile array expressions, and sums them in no particular order.
"""

from __future__ import annotations

import math

import numpy as np

from fusiond.numerics.kernel import entry, kernel
from fusiond.numerics.ud import Matrix

TERMS = 20
"""Of a series whose k-th term is below 1 / (k + 1)!: what is cut off is below 1e-19."""


@kernel
def wrap_angle(angle_rad: float) -> float:
    """The same direction in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


@kernel
def norm_bound(A: Matrix) -> float:
    """Upper bound of the largest singular value: the largest sum of absolute values in a row or a column."""
    largest = 0.0
    for i in range(A.shape[0]):
        row, column = 0.0, 0.0
        for j in range(A.shape[0]):
            row += abs(A[i, j])
            column += abs(A[j, i])
        largest = max(largest, row, column)
    return largest


@kernel
def multiply(factor: float, A: Matrix, B: Matrix, C: Matrix) -> None:
    """Write C = factor A B, summed in order."""
    for i in range(A.shape[0]):
        for j in range(B.shape[1]):
            total = 0.0
            for k in range(A.shape[1]):
                total += A[i, k] * B[k, j]
            C[i, j] = factor * total


@kernel
def add_congruence(F: Matrix, Q: Matrix, T: Matrix) -> None:
    """Q <- Q + F Q F', symmetric as Q is. T: scratch of Q's shape."""
    n = Q.shape[0]
    multiply(1.0, F, Q, T)
    for i in range(n):
        for j in range(i, n):
            total = Q[i, j]
            for k in range(n):
                total += T[i, k] * F[j, k]
            Q[i, j] = total
    for i in range(n):
        for j in range(i):
            Q[i, j] = Q[j, i]


@kernel
def brief_integrals(A: Matrix, D: Matrix, h_s: float, F: Matrix, S: Matrix, Q: Matrix) -> None:
    """F = exp(A h), S = int exp(A s) ds, Q = int exp(A s) D exp(A' s) ds to s = h, by series; norm_bound(A) h <= 1/2.

    The terms of Q are M_0 = D h, M_k = (A M_(k-1) + M_(k-1) A') h / (k + 1).
    """
    n = A.shape[0]
    power, M, T = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    for i in range(n):
        power[i, i] = 1.0
        for j in range(n):
            M[i, j] = D[i, j] * h_s
    for k in range(1, TERMS + 1):
        for i in range(n):
            for j in range(n):
                F[i, j] += power[i, j]
                S[i, j] += power[i, j] * (h_s / k)
                Q[i, j] += M[i, j]
        multiply(h_s / k, A, power, T)
        for i in range(n):
            for j in range(n):
                power[i, j] = T[i, j]
        multiply(h_s / (k + 1), A, M, T)
        for i in range(n):
            for j in range(n):
                M[i, j] = T[i, j] + T[j, i]


@entry
def van_loan(A: Matrix, B: Matrix, spectral_density: Matrix, dt_s: float) -> tuple[Matrix, Matrix, Matrix]:
    """Exact discretisation of dx = A x dt + B u dt + dw, E[dw dw'] = spectral_density dt, u held over the interval.

    Van Loan's integrals over a short interval, by series instead of his block exponential, then doubled up to dt_s:
    a long interval of a fast, stable system would overflow exp(-A dt), while Q <- Q + F Q F' only ever adds.

    Args:
        A: (n, n), 1/s.   B: (n, m).   spectral_density: (n, n), positive semi-definite.   dt_s: interval, s.
    Returns:
        F (n, n), B_d (n, m), the integral of exp(A s) B, and Q (n, n), symmetric.
    Source: Van Loan 1978. Law: tests/laws/test_discretise.py, against scipy.linalg.expm and quadrature.
    """
    n, m = B.shape
    doublings = 0
    short_s = dt_s
    while norm_bound(A) * short_s > 0.5 and doublings < 200:
        short_s *= 0.5
        doublings += 1
    F, S, Q = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    B_d, T = np.zeros((n, m)), np.zeros((n, n))
    brief_integrals(A, spectral_density, short_s, F, S, Q)
    for _ in range(doublings):
        add_congruence(F, Q, T)
        multiply(1.0, F, S, T)
        for i in range(n):
            for j in range(n):
                S[i, j] += T[i, j]
        multiply(1.0, F, F, T)
        for i in range(n):
            for j in range(n):
                F[i, j] = T[i, j]
    multiply(1.0, S, B, B_d)
    return F, B_d, Q
