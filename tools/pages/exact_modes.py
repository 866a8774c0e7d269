"""The fusion modes that are one filter, side by side on the same readings: how far apart they drift.

Three sensors, two of them on one output, on the reference plant with full process noise, from the seed's singular
prior; at every step about a third of the sensors stay silent and the rest come in random order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from fusiond.filters import conventional, information, joseph
from fusiond.filters.innovation import Innovation
from fusiond.fusion import centralized, federated, information_sum
from fusiond.simulation.linear_plants import ReferencePlant

Floats = NDArray[np.float64]
Estimate = tuple[Floats, Floats]
Mode = Callable[[Floats, Floats, Mapping[int, Innovation]], Estimate]

A, B = np.array(ReferencePlant().A), np.array(ReferencePlant().B)
ROWS = (np.array([[1.0, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 1.0, -0.5]]))
R = tuple(np.array([[r]]) for r in (1.0, 25.0, 0.3))
SHARES = (0.5, 0.2, 0.3)
PRIOR = 2.3 * np.outer(B, B)
Q = PRIOR + 0.01 * np.eye(3)
LAG = np.array([0.3, -0.2, 0.1])
"""A node of the information sum looks from its own mean, not from the centre's."""


def stacked(x: Floats, P: Floats, parts: Mapping[int, Innovation]) -> Estimate:
    """All readings as one."""
    return joseph.update(x, P, centralized.stacked(list(parts.values())))


def sequential(x: Floats, P: Floats, parts: Mapping[int, Innovation]) -> Estimate:
    """One after the other."""
    return centralized.update_sequential(x, P, list(parts.values()), joseph.update)


def informed(x: Floats, P: Floats, parts: Mapping[int, Innovation]) -> Estimate:
    """Their information added up."""
    return information.update_together(x, P, list(parts.values()))


def federated_reset(x: Floats, P: Floats, parts: Mapping[int, Innovation]) -> Estimate:
    """Every sensor's own filter holds a share of the prior, meets its own reading, and all are merged."""
    own = [(x, P_i) for P_i in federated.split(P, SHARES)]
    for i, part in parts.items():
        own[i] = joseph.update(*own[i], part)
    return federated.merge(own)


def information_summed(x: Floats, P: Floats, parts: Mapping[int, Innovation]) -> Estimate:
    """Every reading is taken at its node's own mean, x + LAG, and its information sent."""
    after = x
    for part in parts.values():
        at_node = Innovation(part.nu - part.H @ LAG, part.H, part.R)
        after, P = information_sum.absorb(after, P, x + LAG, at_node)
    return after, P


MODES: tuple[Mode, ...] = (stacked, sequential, informed, federated_reset, information_summed)


def readings(rng: np.random.Generator, truth: Floats) -> dict[int, Floats]:
    """What the sensors that speak this time say, by number, in random order."""
    spoke = [i for i in rng.permutation(3).tolist() if rng.random() > 0.3]
    return {i: ROWS[i] @ truth + np.sqrt(R[i][0]) * rng.standard_normal() for i in spoke}


def difference(mine: Estimate, theirs: Estimate) -> float:
    """Largest difference of x and P, relative to the deviations."""
    (x, P), (x_ref, P_ref) = mine, theirs
    s = np.sqrt(np.diagonal(P_ref))
    return float(max(np.abs((x - x_ref) / s).max(), np.abs((P - P_ref) / s[:, None] / s[None, :]).max()))


def worst_differences(steps: int, seed: int = 0) -> dict[str, float]:
    """Run all modes side by side; largest difference of each from the first, by name."""
    rng = np.random.default_rng(seed)
    held: dict[Mode, Estimate] = {mode: (np.zeros(3), PRIOR) for mode in MODES}
    worst, truth, root = dict.fromkeys(MODES, 0.0), B * rng.standard_normal(), np.linalg.cholesky(Q)
    for k in range(steps):
        z = readings(rng, truth)
        drive = B * np.sin(k / 5.0)
        for mode, (x, P) in held.items():
            parts = {i: Innovation(value - ROWS[i] @ x, ROWS[i], R[i]) for i, value in z.items()}
            after, P_after = mode(x, P, parts) if parts else (x, P)
            held[mode] = A @ after + drive, conventional.predict(P_after, A, Q)
            if k % 50 == 0 or k == steps - 1:
                worst[mode] = max(worst[mode], difference(held[mode], held[stacked]))
        truth = A @ truth + drive + root @ rng.standard_normal(3)
    return {getattr(mode, "__name__", ""): value for mode, value in worst.items()}
