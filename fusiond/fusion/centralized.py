"""Centralized fusion of readings with one stamp: stacked, one after the other, as information, and seed 004's average.

All innovations are taken from the same prior mean. The first three are the same estimate by three routes; the fourth
is the seed's Model 1 of the centralized filter (Tables 5-1, 5-2), which is not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fusiond.filters.conventional import gain
from fusiond.filters.innovation import Innovation, Matrix, Vector

Update = Callable[[Vector, Matrix, Innovation], tuple[Vector, Matrix]]


def stacked(parts: Sequence[Innovation]) -> Innovation:
    """All readings as one: nu and H stacked, R block-diagonal."""
    rows = [part.nu.shape[0] for part in parts]
    R = np.zeros((sum(rows), sum(rows)))
    at = 0
    for part, m in zip(parts, rows, strict=True):
        R[at : at + m, at : at + m] = part.R
        at += m
    return Innovation(np.concatenate([part.nu for part in parts]), np.vstack([part.H for part in parts]), R)


def update_sequential(
    x: Vector, P: Matrix, parts: Sequence[Innovation], update: Update
) -> tuple[Vector, Matrix]:
    """One reading after the other, each innovation moved to the mean it then meets."""
    after = x
    for part in parts:
        moved = Innovation(part.nu - part.H @ (after - x), part.H, part.R)
        after, P = update(after, P, moved)
    return after, P


@dataclass(frozen=True, slots=True)
class Averaged:
    """Outcome of an averaged-gain update.

    Args:
        x: (n,).   P: (n, n) as the seed reports it (5-6), which is not the error covariance of that gain.
        honest: (n, n) the error covariance, given that of the prior.
    """

    x: Vector
    P: Matrix
    honest: Matrix


def update_averaged(x: Vector, P: Matrix, honest: Matrix, parts: Sequence[Innovation]) -> Averaged:
    """Seed 004's centralized Model 1: every sensor's own gain, averaged.

        M^i = P C_i' (C_i P C_i' + R_i)^-1                        (5-4), transposes and inverse restored
        x(n|n) = x + 1/N sum M^i r^i,  r^i = yv^i - C_i x         (5-5), its r^i never defined
        P(n|n) = [I - 1/N sum M^i C^i] P                          (5-6)

    beside the covariance that correction really has (Joseph, its R block-diagonal):

        honest+ = (I - 1/N sum M^i C_i) honest (...)' + 1/N^2 sum M^i R_i M^i'

    Args:
        P: (n, n) the reported prior, from which the gains are computed.   honest: (n, n) the prior's true covariance.
        parts: N >= 1 readings.
    """
    share = 1.0 / len(parts)
    kept, step, noise = np.eye(x.shape[0]), np.zeros(x.shape[0]), np.zeros_like(P)
    for part in parts:
        M = gain(P, part)
        kept = kept - share * (M @ part.H)
        step = step + share * (M @ part.nu)
        noise = noise + share * share * (M @ part.R @ M.T)
    after = kept @ honest @ kept.T + noise
    return Averaged(x + step, kept @ P, 0.5 * (after + after.T))
