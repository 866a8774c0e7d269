"""Optimal regulators of sampled plants: the discrete Riccati equation, and costs sampled exactly.

At design time only: scipy, no kernels.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]

RESIDUAL = 1e-8
"""Largest residual of a Riccati solution, relative to the solution."""


class Unsolvable(ValueError):
    """Raised when no stabilising solution exists, or none was found to the promised accuracy."""


def symmetric(M: Matrix) -> Matrix:
    """The symmetric part of M, all that a quadratic form knows of it."""
    return np.asarray(0.5 * (M + M.T), dtype=np.float64)


def regulator(F: Matrix, B: Matrix, cost: Matrix) -> tuple[Matrix, Matrix]:
    """The feedback u = -K x that minimises the sum of (x, u)' cost (x, u) subject to x+ = F x + B u.

    With cost = [[Q, N], [N', R]]:  S = Q + F' S F - (F' S B + N) K,   K = (R + B' S B)^-1 (B' S F + N').

    Args:
        F: (n, n).   B: (n, m).   cost: (n + m, n + m), positive semi-definite, R + B' S B regular.
    Returns:
        K (m, n), and S (n, n), the cost still to come: x' S x.
    Raises:
        Unsolvable: the pair is not stabilisable, the cost does not see an unstable mode, or the residual is large.
    Law: tests/laws/test_regulator.py (residual, python-control, cost by simulation).
    """
    from scipy.linalg import (
        solve_discrete_are,  # a third of a second to load, which a daemon without it is spared
    )

    n = len(F)
    Q, N, R = cost[:n, :n], cost[:n, n:], cost[n:, n:]
    try:
        S = symmetric(np.asarray(solve_discrete_are(F, B, Q, R, s=N), dtype=np.float64))
        K: Matrix = np.asarray(np.linalg.solve(R + B.T @ S @ B, B.T @ S @ F + N.T), dtype=np.float64)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise Unsolvable(str(error)) from error
    off = riccati_residual(F, B, cost, S, K)
    largest = max(abs(np.linalg.eigvals(F - B @ K))) if n else 0.0
    if not off < RESIDUAL or not largest < 1.0:
        raise Unsolvable(f"residual {off:.1e}, largest closed-loop eigenvalue {largest:.6g}")
    return K, S


def riccati_residual(F: Matrix, B: Matrix, cost: Matrix, S: Matrix, K: Matrix) -> float:
    """Largest violation of S = Q + F' S F - (F' S B + N) K, relative to S."""
    n = len(F)
    Q, N = cost[:n, :n], cost[:n, n:]
    off = Q + F.T @ S @ F - (F.T @ S @ B + N) @ K - S
    return float(np.abs(off).max() / max(np.abs(S).max(), 1e-300))


def hold(A: Matrix, B: Matrix, density: Matrix, dt_s: float) -> tuple[Matrix, Matrix, Matrix]:
    """Sample x' = A x + B u over dt_s with u held, and with it the cost density (x, u)' density (x, u).

    Returns:
        F (n, n), G (n, m), and the cost of the interval as a form in (x, u) at its begin, (n + m, n + m): it has a
        cross weight even where the density has none.
    Source: Van Loan 1978. Law: tests/laws/test_regulator.py, against quadrature.
    """
    from scipy.linalg import expm

    n, m = B.shape
    size = n + m
    Z = np.zeros((size, size))
    Z[:n, :n], Z[:n, n:] = A, B
    block = np.zeros((2 * size, 2 * size))
    block[:size, :size], block[:size, size:], block[size:, size:] = -Z.T, density, Z
    whole = expm(block * dt_s)
    through = whole[size:, size:]
    return through[:n, :n], through[:n, n:], symmetric(through.T @ whole[:size, size:])


def generator(F: Matrix, B: Matrix, dt_s: float) -> tuple[Matrix, Matrix]:
    """A and B of the continuous plant that, held over dt_s, is F and B; raises Unsolvable where there is none."""
    from scipy.linalg import expm, logm

    n, m = B.shape
    block = np.eye(n + m)
    block[:n, :n], block[:n, n:] = F, B
    Z = np.asarray(logm(block))
    off = np.abs(expm(np.real(Z)) - block).max()
    if np.iscomplexobj(Z) and np.abs(Z.imag).max() > 1e-9:
        off = np.inf
    if not off < 1e-8 * max(1.0, np.abs(block).max()):
        raise Unsolvable("the model's step is that of no continuous plant")
    Z = np.real(Z) / dt_s
    return Z[:n, :n], Z[:n, n:]
