"""Exact run lengths of the log likelihood ratio CUSUM for a shift of known size in white unit noise.

    L(k+1) = max(0, L(k) + g),    alarm at L >= h,    g ~ N(-(d^2 - b^2)/2, (d - b)^2) while the mean of the noise is 0,

the log likelihood ratio of a mean d against a mean b (b = 0 but for a dead band: a mean up to b is then no change). The
average run length A(l) from L = l solves A(l) = 1 + P(l + g <= 0) A(0) + int_0^h A(y) f(y - l) dy. The point mass at 0
is an unknown of its own, the integral a Gauss-Legendre sum (Nystrom), exact to rounding as the density is smooth.

Source: Page 1954; Moustakides 1986 (this CUSUM has the smallest worst-case delay of all tests with its run length).
Test: tests/calibration/test_cusum.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import ndtr

from fusiond.numerics.ud import Matrix, Vector

SINGLE = 0.9
"""No single reading carries a statistic that stands at zero further than this share of its threshold."""


@dataclass(frozen=True, slots=True)
class Steps:
    """Law of one increment: normal with this mean and standard deviation."""

    mean: float
    std: float


def steps_without(shift: float, dead_band: float = 0.0) -> Steps:
    """Law of the increment while nothing has changed; shift > dead_band >= 0."""
    return Steps(-0.5 * (shift * shift - dead_band * dead_band), shift - dead_band)


def steps_with(shift: float) -> Steps:
    """Law of the increment after a change of the mean to the shift tested for."""
    before = steps_without(shift)
    return Steps(before.mean + before.std * shift, before.std)


@lru_cache(maxsize=64)
def _legendre(count: int) -> tuple[Vector, Vector]:
    """Nodes and weights of Gauss-Legendre on (0, 1)."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return 0.5 * (nodes + 1.0), 0.5 * weights


def panel(low: float, high: float, width: float) -> tuple[Vector, Vector]:
    """Gauss-Legendre nodes and weights on (low, high), dense enough for normal densities of this width."""
    nodes, weights = _legendre(8 + math.ceil(2.0 * (high - low) / width))
    return low + (high - low) * nodes, (high - low) * weights


def densities(points: Vector, nodes: Vector, steps: Steps) -> Matrix:
    """(points, nodes): density of a step from each point to each node."""
    z = (nodes[None, :] - points[:, None] - steps.mean) / steps.std
    density: Matrix = np.exp(-0.5 * z * z) * (0.3989422804014327 / steps.std)
    return density


def average_run_length(threshold: float, steps: Steps) -> float:
    """Mean number of readings until the alarm at h = `threshold` > 0, from L = 0."""
    nodes, weights = panel(0.0, threshold, steps.std)
    starts = np.append(0.0, nodes)
    kernel = np.empty((len(starts), len(starts)))
    kernel[:, 0] = ndtr((-starts - steps.mean) / steps.std)
    kernel[:, 1:] = densities(starts, nodes, steps) * weights
    return float(np.linalg.solve(np.eye(len(starts)) - kernel, np.ones(len(starts)))[0])


def shift_threshold(run_length: float, shift: float, dead_band: float = 0.0) -> float:
    """Threshold h whose average run length without a change is `run_length` readings (Newton's slope of ln A is 1)."""
    steps = steps_without(shift, dead_band)
    wanted = math.log(run_length)
    low, high = 0.0, wanted + shift * shift
    h = max(wanted - 2.5, 0.3)
    for _ in range(60):
        error = wanted - math.log(average_run_length(h, steps))
        if abs(error) < 1e-9:
            break
        low, high = (h, high) if error > 0.0 else (low, h)
        newton = h + error
        h = newton if low < newton < high else 0.5 * (low + high)
    return h


def shift_delay(threshold: float, shift: float) -> float:
    """Mean number of readings from the change to the alarm, with L = 0 at the change (the worst case)."""
    return average_run_length(threshold, steps_with(shift))
