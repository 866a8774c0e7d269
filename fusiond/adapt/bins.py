"""Interacting models with a filter for each bin of levels: the sharper form, for one scalar sensor and a small state.

A filter for each level would cost too much, one for all blurs what levels far apart make of the state; a filter for
every few neighbouring levels costs little and keeps them apart. Before a reading, bin b, which carries the probability
W_b, takes in what jumps into it: with h the hazard and J_b the share of jumps that end in it,

    W_b <- (1 - h) W_b + h J_b,

and its moments become those of the mixture of its own, weighing (1 - h) W_b, and of all bins together, weighing h J_b.
Each bin is then updated as `fusiond.adapt.interacting` does with its own levels, and the estimate is the mixture of the
bins, matched in its first two moments.

Source: Blom & Bar-Shalom 1988, IEEE T-AC 33(8), with the levels of one bin merged.
"""

from __future__ import annotations

from typing import Any

from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import ud_compose, ud_factor


@kernel
def blend(U: Any, d: Any, gap: Any, share: float, P: Any, mixed: Any) -> None:
    """U diag(d) U' <- the covariance of a mixture of itself, weighing `share`, and of P, their means `gap` apart.

    The mean is the caller's: it moves by (1 - share) gap.   mixed: (n, n) scratch.
    """
    n = d.shape[0]
    ud_compose(U, d, mixed)
    for i in range(n):
        for j in range(n):
            mixed[i, j] = share * mixed[i, j] + (1.0 - share) * (P[i, j] + share * gap[i] * gap[j])
    ud_factor(mixed, U, d, 1e-9)


@kernel
def add_moments(U: Any, d: Any, gap: Any, share: float, mixed: Any, P: Any) -> None:
    """P += share (U diag(d) U' + gap gap').   mixed: (n, n) scratch."""
    n = d.shape[0]
    ud_compose(U, d, mixed)
    for i in range(n):
        for j in range(n):
            P[i, j] += share * (mixed[i, j] + gap[i] * gap[j])
