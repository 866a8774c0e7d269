"""Seed 004, Model 2 (Table 3-1): the update in information form, twice.

    as printed (3-4)   P(n|n)^-1 = P^-1 + C' R^-1 C       fails where the prior is singular, as it is at the start
    Woodbury form      P(n|n) = (I + P C' R^-1 C)^-1 P     the same P(n|n), without P^-1: exact for a singular prior

Both with M = P(n|n) C' R^-1, which Table 3-1 uses and never defines. A singular R (a perfect channel) has no
information form, and a sum I + P C' R^-1 C that rounding made singular no inverse; there the Joseph update stands in.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusiond.filters import joseph
from fusiond.filters.innovation import Innovation, Matrix, Vector

LARGEST = 1e300
"""Beyond it, products overflow."""


def weight(R: Matrix) -> Matrix | None:
    """R^-1, None where R is singular, or so large that its reading says nothing a float could hold."""
    if not np.max(np.abs(R)) < LARGEST:
        return None
    values, vectors = np.linalg.eigh(R)
    if not values[0] > values.shape[0] * np.finfo(float).eps * abs(values[-1]):
        return None
    return np.asarray((vectors / values) @ vectors.T)


def contribution(seen: Innovation, W: Matrix) -> tuple[Vector, Matrix]:
    """What a reading adds to the information about x - x(prior): C' R^-1 nu (n,) and C' R^-1 C (n, n)."""
    weighted = seen.H.T @ W
    return weighted @ seen.nu, weighted @ seen.H


def absorb(x: Vector, P: Matrix, y: Vector, Y: Matrix) -> tuple[Vector, Matrix]:
    """Add information: P+ = (I + P Y)^-1 P, x+ = x + P+ y. P may be singular.

    Args:
        y: (n,) sum of C' R^-1 nu.   Y: (n, n) sum of C' R^-1 C, positive semi-definite.
    """
    after = np.linalg.solve(np.eye(P.shape[0]) + P @ Y, P)
    after = 0.5 * (after + after.T)
    return x + after @ y, np.asarray(after)


def absorbed(x: Vector, P: Matrix, y: Vector, Y: Matrix) -> tuple[Vector, Matrix] | None:
    """`absorb`, or None where rounding or overflow has left nothing to solve."""
    try:
        after = absorb(x, P, y, Y)
    except np.linalg.LinAlgError:
        return None
    return after if np.isfinite(after[1]).all() else None


def update(x: Vector, P: Matrix, seen: Innovation) -> tuple[Vector, Matrix]:
    """Condition N(x, P) on the innovation, Woodbury form."""
    W = weight(seen.R)
    if W is None:
        return joseph.update(x, P, seen)
    return absorbed(x, P, *contribution(seen, W)) or joseph.update(x, P, seen)


def update_together(x: Vector, P: Matrix, parts: Sequence[Innovation]) -> tuple[Vector, Matrix]:
    """Condition on several independent readings at once: their information adds up.

    All innovations are taken from the same prior mean. Those without an information form follow one after the other.
    """
    y, Y, weights = np.zeros(x.shape[0]), np.zeros_like(P), [weight(seen.R) for seen in parts]
    for seen, W in zip(parts, weights, strict=True):
        if W is not None:
            more_y, more_Y = contribution(seen, W)
            y, Y = y + more_y, Y + more_Y
    left = [seen for seen, W in zip(parts, weights, strict=True) if W is None]
    summed = absorbed(x, P, y, Y)
    after, P = summed or (x, P)
    for seen in left if summed else parts:
        moved = Innovation(seen.nu - seen.H @ (after - x), seen.H, seen.R)
        after, P = joseph.update(after, P, moved)
    return after, P


def update_by_inverse(x: Vector, P: Matrix, seen: Innovation) -> tuple[Vector, Matrix]:
    """Condition N(x, P) on the innovation as printed (3-4): two explicit inverses.

    An exactly singular prior has no inverse; there the Woodbury form stands in. What is only nearly singular is
    inverted, as the seed would: repair it first.
    """
    W = weight(seen.R)
    if W is None:
        return joseph.update(x, P, seen)
    try:
        after = np.linalg.inv(np.linalg.inv(P) + seen.H.T @ W @ seen.H)
    except np.linalg.LinAlgError:
        return update(x, P, seen)
    return x + after @ seen.H.T @ (W @ seen.nu), np.asarray(after)
