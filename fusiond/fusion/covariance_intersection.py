"""Covariance intersection: estimates of unknown provenance, which may share any of their information.

    P^-1 = sum w_i P_i^-1,   P^-1 x = sum w_i P_i^-1 x_i,   w_i >= 0,  sum w_i = 1

Never optimistic whatever the correlation, for any weights; these maximise det P^-1, which does not depend on units.
Source: Julier & Uhlmann 1997. The weights are a D-optimal design: Titterington's multiplicative algorithm, monotone.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusiond.filters.innovation import Matrix, Vector

PASSES = 60
"""Passes of the weight iteration at most; any weights are valid, better ones only sharper."""
ENOUGH = 1e-6
"""Change of the weights at which it stops."""


def weights(information: Matrix) -> Vector:
    """(k,) weights that maximise det sum w_i Y_i: w_i <- w_i tr(P Y_i) / n until they rest.

    Args:
        information: (k, n, n) Y_i = P_i^-1, in coordinates of any unit.
    """
    count, n = information.shape[:2]
    flat, w = information.reshape(count, n * n), np.full(count, 1.0 / count)
    for _ in range(PASSES):
        P = np.linalg.inv((w @ flat).reshape(n, n))
        next_w = w * (flat @ P.ravel())
        next_w /= next_w.sum()
        rested = float(np.max(np.abs(next_w - w))) <= ENOUGH
        w = next_w
        if rested:
            break
    return w


def intersect(estimates: Sequence[tuple[Vector, Matrix]]) -> tuple[Vector, Matrix]:
    """One estimate no more confident than their possible correlation allows.

    Directions in which every P_i is zero are left as they are (all know the state there); where only some are, the
    estimate with the least total relative variance is taken as it is, which is the vertex w_i = 1.
    """
    s = np.sqrt(np.maximum(sum(np.diagonal(P) for _, P in estimates), 0.0))
    s = np.where((s > 0.0) & np.isfinite(s), s, 1.0)
    means = [x / s for x, _ in estimates]
    covariances = [P / s[:, None] / s[None, :] for _, P in estimates]
    values, vectors = np.linalg.eigh(sum(covariances))
    open_to = vectors[:, values > 1e-14 * max(float(values[-1]), 0.0)]
    if open_to.shape[1] == 0:
        return estimates[0]
    inner = [open_to.T @ P @ open_to for P in covariances]
    if any(np.linalg.eigvalsh(P)[0] <= 1e-14 * np.trace(P) for P in inner):
        return estimates[int(np.argmin([np.trace(P) for P in covariances]))]
    Y = np.linalg.inv(np.array(inner))
    w = weights(Y)
    P = np.linalg.inv(sum(share * each for share, each in zip(w, Y, strict=True)))
    pulls = zip(w, Y, means, strict=True)
    step = P @ sum(share * (each @ (open_to.T @ (x - means[0]))) for share, each, x in pulls)
    after = open_to @ P @ open_to.T * s[:, None] * s[None, :]
    return np.asarray(s * (means[0] + open_to @ step)), np.asarray(0.5 * (after + after.T))
