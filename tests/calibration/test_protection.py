"""The share of samples outside their protection level, with no fault, and with faults that hide below detection."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from fusiond.faults.protection import protection_levels, quantile

RUNS, STEPS, R, Q = 4000, 50, 1.0, 0.5
SENSORS = 3
OUTSIDE = 0.01
Vector = NDArray[np.float64]


def random_walk(size: float, seed: int) -> tuple[Vector, Vector, Vector]:
    """A random walk read by equal sensors, the first of them wrong by `size`, after STEPS readings of each.

    Returns:
        errors (RUNS,) of the filter of all, separations (RUNS, SENSORS), variances (1 + SENSORS,) of all filters.
    """
    rng = np.random.default_rng(seed)
    heard = [range(SENSORS), *([j for j in range(SENSORS) if j != i] for i in range(SENSORS))]
    p, x, truth = np.ones(len(heard)), np.zeros((len(heard), RUNS)), rng.standard_normal(RUNS)
    for _ in range(STEPS):
        truth = truth + np.sqrt(Q) * rng.standard_normal(RUNS)
        z = truth + np.sqrt(R) * rng.standard_normal((SENSORS, RUNS))
        z[0] += size
        for row, own in enumerate(heard):
            S = (p[row] + Q) * len(own) + R
            x[row] += (p[row] + Q) / S * np.sum(z[list(own)] - x[row], axis=0)
            p[row] = (p[row] + Q) * R / S
    return x[0] - truth, (x[0] - x[1:]).T, p


@pytest.mark.parametrize("size", [0.0, 1.0, 2.0, 4.0, 30.0])
def test_no_more_samples_lie_outside_than_promised(size: float) -> None:
    """A constant fault of any size on one of three sensors: at most 1 % outside, within the binomial's interval."""
    errors, apart, p = random_walk(size, seed=int(10 * size))
    levels = [
        protection_levels(OUTSIDE, np.eye(1), p[:1, None], d[:, None], p[1:, None, None])[0] for d in apart
    ]
    assert int(np.sum(np.abs(errors) > levels)) <= binom.ppf(0.999, RUNS, OUTSIDE)


def test_without_separations_the_level_is_the_quantile() -> None:
    """One sensor fewer to doubt: exactly the promised share lies outside, from both sides."""
    errors, _, p = random_walk(0.0, seed=7)
    level = protection_levels(OUTSIDE, np.eye(1), p[:1, None], np.zeros((0, 1)), np.zeros((0, 1, 1)))[0]
    assert level == pytest.approx(quantile(OUTSIDE) * np.sqrt(p[0]))
    low, high = binom.ppf([0.001, 0.999], RUNS, OUTSIDE)
    assert low <= int(np.sum(np.abs(errors) > level)) <= high


def test_a_sensor_nothing_can_replace_makes_the_level_huge() -> None:
    level = protection_levels(OUTSIDE, np.eye(1), np.eye(1), np.zeros((1, 1)), np.full((1, 1, 1), 1e12))[0]
    assert level > 1e6
