"""The plant that stands for seed 004's, and random ones: what the laws of its filters and its fusion share."""

from __future__ import annotations

import numpy as np

from tools.pages.bank_truth import System

A = np.array([[1.1269, -0.4940, 0.1129], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
B = np.array([[-0.3832], [0.5919], [0.5191]])
C = np.array([[1.0, 0.0, 0.0]])
ONE = np.array([[1.0]])
FIGURES = {
    1.0: ([0.3798, 0.0817, -0.2570], 5e-5, 1.61238, 5e-6, 0.379797),
    2.3: ([0.534538, 0.010133, -0.477568], 1e-6, 2.148401, 1e-6, 0.534538),
}
"""By Q, with R = 1: steady gain M and its digits, innovation variance S and its digits, C P+ C'."""


def noise(Q: float) -> np.ndarray:
    """B Q B', the noise that enters with the input."""
    return B @ B.T * Q


def sharing(R: tuple[float, ...], Q: float = 2.3) -> System:
    """The reference plant with one sensor for each R, all on its output, started at the seed's singular prior."""
    return System(A, noise(Q), (C,) * len(R), tuple(r * ONE for r in R), noise(Q))


def random_plant(seed: int, sensors: int, n: int = 4, decades: float = 2.0) -> System:
    """A stable plant with full noise; every sensor reads one or two random combinations of the states.

    Their R lie within 10^-decades to 10^decades.
    """
    rng = np.random.default_rng(seed)
    moves = rng.standard_normal((n, n))
    moves *= rng.uniform(0.5, 0.97) / np.max(np.abs(np.linalg.eigvals(moves)))
    root = rng.standard_normal((n, n))
    rows = [rng.standard_normal((rng.integers(1, 3), n)) for _ in range(sensors)]
    R = [np.diag(10.0 ** rng.uniform(-decades, decades, len(H))) for H in rows]
    return System(moves, root @ root.T, tuple(rows), tuple(R), root @ root.T)
