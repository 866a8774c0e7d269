"""Covariance as U diag(d) U': factor, measure, condition, predict. No square roots, never indefinite.

Throughout, U is (n, n) unit upper triangular; only elements above its diagonal are read or written, and d is (n,),
d >= 0. The scratch arguments are overwritten and mean nothing afterwards.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fusiond.numerics.kernel import kernel

LARGEST_VARIANCE = 1e290
"""A variance grows no further: an unstable mode that nobody sees must not overflow into the others."""
LARGEST_STATE = 1e145
"""Nor does a state of a linear model in the compiled step: the square root of that."""

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]


@kernel
def ud_factor(P: Matrix, U: Matrix, d: Vector, tolerance: float) -> bool:
    """Factor a symmetric positive semi-definite P into U diag(d) U'. P is destroyed.

    Args:
        P: (n, n); its upper triangle is read.   U, d: outputs.
        tolerance: a pivot below -tolerance times the largest diagonal element means P is indefinite; a smaller
            negative one is rounding and becomes zero.
    Returns:
        False where P is indefinite or not finite (U and d are then meaningless).
    Source: Bierman 1977, section III.4; a zero pivot (singular P) zeroes its column.
    """
    n = P.shape[0]
    largest = 0.0
    for j in range(n):
        largest = max(largest, abs(P[j, j]))
    if not np.isfinite(largest):
        return False
    slack = tolerance * largest
    for j in range(n - 1, -1, -1):
        pivot = P[j, j]
        if not pivot >= -slack:
            return False
        d[j] = max(pivot, 0.0)
        U[j, j] = 1.0
        for i in range(j):
            if d[j] > 0.0:
                U[i, j] = P[i, j] / d[j]
            else:
                if not abs(P[i, j]) <= slack:
                    return False
                U[i, j] = 0.0
        for i in range(j):
            for k in range(i + 1):
                P[k, i] -= U[k, j] * d[j] * U[i, j]
    return True


@kernel
def ud_compose(U: Matrix, d: Vector, P: Matrix) -> None:
    """Write P = U diag(d) U' (n, n), both triangles."""
    n = d.shape[0]
    for i in range(n):
        for j in range(i, n):
            total = d[j] if i == j else U[i, j] * d[j]
            for k in range(j + 1, n):
                total += U[i, k] * d[k] * U[j, k]
            P[i, j] = total
            P[j, i] = total


@kernel
def ud_variance(U: Matrix, d: Vector, i: int) -> float:
    """Element (i, i) of U diag(d) U'."""
    total: float = d[i]
    for k in range(i + 1, d.shape[0]):
        total += U[i, k] * U[i, k] * d[k]
    return total


@kernel
def ud_covariance(U: Matrix, d: Vector, i: int, j: int) -> float:
    """Element (i, j) of U diag(d) U'."""
    low, high = (i, j) if i < j else (j, i)
    if low == high:
        return ud_variance(U, d, i)
    total: float = U[low, high] * d[high]
    for k in range(high + 1, d.shape[0]):
        total += U[low, k] * U[high, k] * d[k]
    return total


@kernel
def ud_add(U: Matrix, d: Vector, a: Vector, c: float) -> None:
    """U diag(d) U' <- U diag(d) U' + c a a', c >= 0, in place; a is destroyed.

    Source: Agee & Turner 1972; Bierman 1977, section III.5. Law: tests/laws/test_unobserved.py.
    """
    for j in range(d.shape[0] - 1, -1, -1):
        old = d[j]
        d[j] = old + c * a[j] * a[j]
        if not d[j] > 0.0:
            continue
        share = c * a[j] / d[j]
        for i in range(j):
            a[i] -= a[j] * U[i, j]
            U[i, j] += share * a[i]
        c *= old / d[j]


@kernel
def ud_projected(U: Matrix, d: Vector, h: Vector) -> float:
    """Variance h' U diag(d) U' h of the number h'x."""
    n = d.shape[0]
    total = 0.0
    for j in range(n):
        a: float = h[j]
        for i in range(j):
            a += U[i, j] * h[i]
        total += d[j] * a * a
    return total


@kernel
def bierman_update(
    x: Vector, U: Matrix, d: Vector, h: Vector, r: float, nu: float, a: Vector, b: Vector
) -> float:
    """Condition N(x, U diag(d) U') on one scalar z = h'x + v, v ~ N(0, r), in place.

    Args:
        x: (n,) prior mean, becomes the posterior mean.
        U, d: the prior covariance, become the posterior's.
        h: (n,) one row of H.   r: its variance, >= 0, in (unit of z)^2.   nu: z - h'x.   a, b: (n,) scratch.
    Returns:
        S = h' P h + r, the variance of nu.
    Never fails: a zero S (perfect, redundant reading) leaves the state as it was.
    Source: Bierman 1977, section V.3. Law: tests/laws/test_ud.py::test_ud_equals_joseph.
    """
    n = x.shape[0]
    for j in range(n):
        a[j] = h[j]
    for i in range(n - 1):
        for j in range(i + 1, n):
            a[j] += U[i, j] * h[i]
    for j in range(n):
        b[j] = d[j] * a[j]
    alpha = r
    for j in range(n):
        beta = alpha
        alpha += a[j] * b[j]
        if alpha > 0.0:
            d[j] *= beta / alpha
        # beta = 0 (no noise so far) leaves no gain in b[:j] to spread
        spread = -a[j] / beta if beta > 0.0 else 0.0
        for i in range(j):
            old = U[i, j]
            U[i, j] = old + spread * b[i]
            b[i] += b[j] * old
    if alpha > 0.0:
        step = nu / alpha
        for i in range(n):
            x[i] += b[i] * step
    return alpha


@kernel
def thornton_predict(U: Matrix, d: Vector, F: Matrix, W: Matrix, w_d: Vector, v: Vector) -> None:
    """Predict a covariance, P <- F P F' + W_Q diag(w_d[n:]) W_Q', in place, by weighted Gram-Schmidt.

    Args:
        U, d: prior covariance, become the predicted one.   F: (n, n) state transition.
        W: (n + k, n) scratch whose rows n.. hold the k noise columns, transposed: W[n + j, i] = W_Q[i, j].
        w_d: (n + k,); elements n.. hold the noise variances.   v: (n,) scratch.
    Variances stop at LARGEST_VARIANCE.
    Source: Thornton 1976; Grewal & Andrews 2015, section 7.6. Law: tests/laws/test_ud.py::test_thornton_equals_dense.
    """
    n = d.shape[0]
    columns = W.shape[0]
    for k in range(n):
        w_d[k] = d[k]
        for i in range(n):
            W[k, i] = 0.0
    for i in range(n):
        for m in range(n):
            f = F[i, m]
            if f != 0.0:
                W[m, i] += f
                for k in range(m + 1, n):
                    W[k, i] += f * U[m, k]
    for j in range(n - 1, -1, -1):
        total = 0.0
        for i in range(j):
            v[i] = 0.0
        for k in range(columns):
            weighted = w_d[k] * W[k, j]
            if weighted != 0.0:
                total += weighted * W[k, j]
                for i in range(j):
                    v[i] += weighted * W[k, i]
        d[j] = min(total, LARGEST_VARIANCE)
        inverse = 1.0 / total if total > 0.0 else 0.0
        for i in range(j):
            v[i] *= inverse
            U[i, j] = v[i]
        for k in range(columns):
            w = W[k, j]
            if w != 0.0:
                for i in range(j):
                    W[k, i] -= v[i] * w


@kernel
def whiten(U: Matrix, nu: Vector, H: Matrix, count: int) -> None:
    """Decorrelate `count` channels whose noise covariance is U diag(d) U': nu <- U^-1 nu, H <- U^-1 H, in place.

    Afterwards the channels are independent with variances d, so they can be fused one by one.
    """
    for j in range(count - 1, 0, -1):
        for i in range(j):
            factor = U[i, j]
            if factor != 0.0:
                nu[i] -= factor * nu[j]
                for k in range(H.shape[1]):
                    H[i, k] -= factor * H[j, k]
