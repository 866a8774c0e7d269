"""Rates and their intervals: how sure a count of alarms, or a share of runs, makes us."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import beta, chi2, t

SURE = 0.95
"""Confidence of every interval."""


@dataclass(frozen=True, slots=True)
class Band:
    """A measured number between `low` and `high`."""

    value: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.value:.3g} ({self.low:.3g} to {self.high:.3g})"


def mean_interval(total: float, alarms: int) -> Band:
    """Mean time between `alarms` alarms of a Poisson process watched for `total`; exact."""
    if alarms == 0:
        return Band(float("inf"), float(2.0 * total / chi2.ppf(SURE, 2)), float("inf"))
    tail = 0.5 * (1.0 - SURE)
    low = 2.0 * total / chi2.ppf(1.0 - tail, 2 * alarms + 2)
    return Band(total / alarms, float(low), float(2.0 * total / chi2.ppf(tail, 2 * alarms)))


def share(hits: int, of: int) -> Band:
    """A share with its interval of Clopper and Pearson."""
    tail = 0.5 * (1.0 - SURE)
    low = float(beta.ppf(tail, hits, of - hits + 1)) if hits else 0.0
    high = float(beta.ppf(1.0 - tail, hits + 1, of - hits)) if hits < of else 1.0
    return Band(hits / of, low, high)


def mean_share(shares: Sequence[float]) -> Band:
    """Mean of the shares of independent runs whose samples hang together, by how the runs scatter (Student)."""
    value, runs = float(np.mean(shares)), len(shares)
    reach = float(t.ppf(0.5 + 0.5 * SURE, runs - 1) * np.std(shares, ddof=1) / np.sqrt(runs))
    return Band(value, max(0.0, value - reach), value + reach)
