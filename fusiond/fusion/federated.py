"""Federated fusion: each sensor's local filter holds a share of prior and process information; the master adds up.

    local i:   Q_i = Q / b_i,  P_i(0) = P(0) / b_i,  sum b_i = 1
    master:    P^-1 = sum P_i^-1,  P^-1 x = sum P_i^-1 x_i

Without reset the locals never hear of each other, so that one sensor's fault stays in its own filter; the master's
covariance is an upper bound, exact where all sensors share H up to scale and b_i is proportional to their
information. With full reset after every reading (x_i = x, P_i = P / b_i) the master is the centralized filter.
Source: Carlson 1990; theory of the bound in docs/seed_004.md.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusiond.filters import joseph
from fusiond.filters.innovation import Innovation, Matrix, Vector

SMALLEST_SHARE = 1e-6
"""A sensor that says next to nothing keeps this share: its filter would otherwise have infinite noise."""


def shares(information: Sequence[float]) -> tuple[float, ...]:
    """b_i proportional to each sensor's information, no less than SMALLEST_SHARE, summing to one."""
    total = float(sum(information))
    raw = [max(value / total if total > 0.0 else 1.0, SMALLEST_SHARE) for value in information]
    return tuple(value / sum(raw) for value in raw)


def merge(estimates: Sequence[tuple[Vector, Matrix]]) -> tuple[Vector, Matrix]:
    """The master of local estimates (x_i, P_i): P^-1 = sum P_i^-1, by one Joseph update after another.

    Each further estimate is a reading of the whole state with R = P_i, so that no P_i needs an inverse and singular
    ones (a perfectly known start) are exact. An estimate that is not finite is left out.
    """
    sound = [(x, P) for x, P in estimates if np.isfinite(x).all() and np.isfinite(P).all()]
    x, P = sound[0] if sound else estimates[0]
    for x_i, P_i in sound[1:]:
        x, P = _joined(x, P, x_i, P_i)
    return x, P


def _joined(x: Vector, P: Matrix, x_i: Vector, P_i: Matrix) -> tuple[Vector, Matrix]:
    """Two estimates whose information adds up."""
    n = x.shape[0]
    total = P + P_i
    s = np.sqrt(np.maximum(np.diagonal(total), 0.0))
    s = np.where(s > 0.0, s, 1.0)
    inverse = np.linalg.pinv(total / s[:, None] / s[None, :], rcond=1e-14, hermitian=True)
    M = (P / s[None, :]) @ inverse / s[None, :]
    return x + M @ (x_i - x), joseph.covariance(P, M, Innovation(x_i - x, np.eye(n), P_i))


def split(P: Matrix, b: Sequence[float]) -> list[Matrix]:
    """Full reset: the covariances P / b_i of the locals that all restart at the master's mean."""
    return [P / share for share in b]
