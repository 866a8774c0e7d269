"""Fixed-interval smoothing: what all of a recording, the future included, says about the state at each update.

The recursion of Bryson and Frazier in its modified form, for scalar updates: from the end to the start it carries an
adjoint of the error, a (n,) with covariance A (n, n), zero after the last update,

    smoothed     x_s = x+ [+] -P+ a,             P_s = P+ - P+ A P+
    one channel  a <- a - h (k'a + nu / S),      A <- (I - k h')' A (I - k h') + h h' / S
    one interval a <- F' a,                      A <- F' A F

the channels of an update from last to first, then the interval that led to it. It gives the smoothed state and
covariance of Rauch, Tung and Striebel without their P-^-1, and without Q: a singular P-, an R of zero and a
singular F need no care. On a nonlinear model F and h are the filter's own Jacobians, and a lives beside the
error of the filter's own state: the smoother of the extended and of the error-state filter.
Source: Bierman 1973, Fixed interval smoothing with discrete measurements, Int. J. Control 18; Rauch, Tung and
Striebel 1965, Maximum likelihood estimates of linear dynamic systems, AIAA J. 3.
Law: tests/laws/test_smoother.py::test_smoothed_is_the_batch_solution.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Adjoint:
    """What later readings want changed: a (n,), and the covariance A (n, n) it has under the model."""

    a: Vector
    A: Matrix

    @property
    def finite(self) -> bool:
        """No NaN, no infinity."""
        return bool(np.isfinite(self.a).all() and np.isfinite(self.A).all())


def end(n: int) -> Adjoint:
    """Nothing comes later."""
    return Adjoint(np.zeros(n), np.zeros((n, n)))


def before_channel(after: Adjoint, h: Vector, k: Vector, nu: float, S: float) -> Adjoint:
    """The adjoint before one scalar update.

    Args:
        h: (n,) its row of H.   k: (n,) its gain.   nu, S: innovation and its variance; S = 0 changed nothing.
    """
    if not S > 0.0:
        return after
    seen = after.A @ k
    a = after.a - h * (k @ after.a + nu / S)
    A = after.A - np.outer(h, seen) - np.outer(seen, h) + np.outer(h, h) * (k @ seen + 1.0 / S)
    return Adjoint(a, A)


def before_interval(after: Adjoint, F: Matrix) -> Adjoint:
    """The adjoint before one prediction; F: (n, n) transition of the error."""
    A = F.T @ after.A @ F
    return Adjoint(F.T @ after.a, np.asarray(0.5 * (A + A.T)))


def smoothed(U: Matrix, d: Vector, a: Matrix, A: Matrix) -> tuple[Matrix, Matrix]:
    """Corrections of the filtered states and their covariances, all at once.

    Args:
        U, d: (k, n, n) unit upper triangular, (k, n): the filtered covariances U diag(d) U'.
        a, A: (k, n), (k, n, n): adjoints after each.
    Returns:
        (k, n) -P+ a and (k, n, n) P+ - P+ A P+ = L (I - L' A L) L', L = U diag(sqrt(d)); the middle factor has its
        eigenvalues between 0 and 1, and what rounding does to that is undone, so that the result is positive
        semi-definite and never above P+.
    """
    n = d.shape[1]
    L = (np.triu(U, 1) + np.eye(n)) * np.sqrt(d)[:, None, :]
    Lt = np.swapaxes(L, 1, 2)
    dx = -(L @ (Lt @ a[:, :, None]))[:, :, 0]
    kept = np.eye(n) - Lt @ A @ L
    values, vectors = np.linalg.eigh(0.5 * (kept + np.swapaxes(kept, 1, 2)))
    half = L @ (vectors * np.sqrt(np.clip(values, 0.0, 1.0))[:, None, :])
    return dx, np.asarray(half @ np.swapaxes(half, 1, 2))
