"""From continuous time to one interval: the exact transition and noise of a linear model, and angles on the circle."""

from __future__ import annotations

import math

import numpy as np

from fusiond.numerics.kernel import entry, kernel
from fusiond.numerics.ud import Matrix


@kernel
def wrap_angle(angle_rad: float) -> float:
    """The same direction in [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


@kernel
def row_norm(A: Matrix) -> float:
    """Largest row sum of absolute values."""
    largest = 0.0
    for i in range(A.shape[0]):
        largest = max(largest, float(np.sum(np.abs(A[i]))))
    return largest


@kernel
def multiply(A: Matrix, B: Matrix) -> Matrix:
    """A B, summed in order: no linear-algebra library, whose bits depend on the machine's choice of one."""
    C = np.zeros((A.shape[0], B.shape[1]))
    for i in range(A.shape[0]):
        for k in range(A.shape[1]):
            for j in range(B.shape[1]):
                C[i, j] += A[i, k] * B[k, j]
    return C


@kernel
def taylor_exponential(A: Matrix) -> Matrix:
    """exp(A) for row_norm(A) <= 1, by its Taylor series to degree 18 (truncation below 1e-17)."""
    total = np.eye(A.shape[0])
    term = np.eye(A.shape[0])
    for degree in range(1, 19):
        term = multiply(term, A) / degree
        total = total + term
    return total


@entry
def van_loan(A: Matrix, B: Matrix, spectral_density: Matrix, dt_s: float) -> tuple[Matrix, Matrix, Matrix]:
    """Exact discretisation of dx = A x dt + B u dt + dw, E[dw dw'] = spectral_density dt, u held over the interval.

    Van Loan's block exponential over a short interval, then doubled up to dt_s: a long interval of a fast, stable
    system would overflow exp(-A dt), while Q <- Q + F Q F' only ever adds. Noise and drive enter scaled to norm one,
    which a block exponential allows because it is linear in them.

    Args:
        A: (n, n), 1/s.   B: (n, m).   spectral_density: (n, n), positive semi-definite.   dt_s: interval, s.
    Returns:
        F (n, n), B_d (n, m), the integral of exp(A s) B, and Q (n, n), symmetric.
    Source: Van Loan 1978. Law: tests/laws/test_discretise.py, against scipy.linalg.expm and quadrature.
    """
    n, m = B.shape
    doublings = 0
    short_s = dt_s
    while row_norm(A) * short_s > 0.5 and doublings < 200:
        short_s *= 0.5
        doublings += 1
    noise_norm = max(1.0, row_norm(spectral_density) * short_s)
    drive_norm = max(1.0, row_norm(B) * short_s)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n] = -A * short_s
    block[:n, n:] = spectral_density * short_s / noise_norm
    block[n:, n:] = A.T * short_s
    exponential = taylor_exponential(block)
    F = exponential[n:, n:].T.copy()
    Q = multiply(F, exponential[:n, n:]) * noise_norm
    driven = np.zeros((n + m, n + m))
    driven[:n, :n] = A * short_s
    driven[:n, n:] = B * short_s / drive_norm
    B_d = taylor_exponential(driven)[:n, n:] * drive_norm
    for _ in range(doublings):
        Q = Q + multiply(multiply(F, Q), F.T)
        B_d = B_d + multiply(F, B_d)
        F = multiply(F, F)
    return F, B_d, 0.5 * (Q + Q.T)
