"""One promise, many thresholds: the service's mean time between false alarms, shared out over all tests.

K tests that raise false alarms independently, each once in K T seconds, together raise one in T seconds. Tests that
are one and the same in disguise (two sensors of one position: one's bias is the other's with the opposite sign) alarm
together and count once. A test is calibrated in readings, by its own average run length.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fusiond.numerics.ud import Matrix, Vector

SAME = 0.95
"""Correlation, in size, of two faults' signatures from which they cannot be told apart in practice."""
ALIKE = 15.0
"""Two suspects whose signatures correlate by c raise 2 / (1 + |c|^ALIKE) times the false alarms of one: measured 1.67
at 0.9 and 1.02 at 0.999."""
NEIGHBOURS = 0.06
"""Each further size of a ladder takes this off the share of its cells that alarm by themselves: measured 0.77 of the
sum for four sizes, 0.70 for six, a factor of two apart."""
FURTHER = 0.28
"""What each further size of a ladder of finite information adds to the false alarms of one: measured 0.36 for the
second, 0.25 for the third, 0.3 for the fourth (constant velocity)."""
GATE_SHARE = 1e-6
"""Probability that a healthy reading is refused by the gate."""


@dataclass(frozen=True, slots=True)
class Promise:
    """What the operator was promised.

    Args:
        interval_s: mean time between false alarms of the whole service.
        dead_band: mean of a whitened innovation that is no fault, for every sensor.
        studentise: share of one reading in the slow innovation variance the tests are scaled by; 0: none.
    """

    interval_s: float
    dead_band: float = 0.0
    studentise: float = 0.0


SHARP = (0.0, 0.0)
ROBUST = (0.06, 0.001)
"""dead_band and studentise of the two profiles: the declared noise is right; or wrong by up to a third."""


def independent(correlation: Matrix) -> Vector:
    """(s,) how many suspects each stands for, in the count of independent false alarms: 1 alone, 1/2 as one of twins.

    Args:
        correlation: (s, s) of the suspects' signatures.
    """
    counts: Vector = 1.0 / np.sum(np.minimum(np.abs(correlation), 1.0) ** ALIKE, axis=1)
    return counts


def alone(sizes: int, finite: bool) -> float:
    """Share of the cells of one ladder that alarm by themselves, not together with a neighbour.

    Args:
        finite: whether the cells share a finite information, so that they mostly alarm together.
    """
    if finite:
        return (1.0 + FURTHER * (sizes - 1)) / max(sizes, 1)
    return max(1.0 - NEIGHBOURS * (sizes - 1), 0.5)


def readings_between(promise: Promise, tests: float, readings_per_s: float, share: float = 1.0) -> float:
    """Average run length, in readings, of one of `tests` tests that sees so many readings a second.

    Args:
        share: of the promise that it may use up, relative to the average test.
    """
    return max(promise.interval_s * tests * readings_per_s / share, 2.0)


def frozen_run(readings: float, repeat_share: float) -> int:
    """Equal values in a row, beyond the first, that chance explains at most once in so many readings.

    Args:
        repeat_share: probability that a healthy sensor repeats a value: about lsb / (2 sqrt(pi) sigma).
    """
    share = min(max(repeat_share, 1e-9), 0.999)
    return max(2, math.ceil(math.log(readings) / -math.log(share)))


WHITENESS = 0.3
"""Correlation of successive innovations that the whiteness test looks for, either sign."""
WHITENESS_A = {1: 3.64, 2: 3.07, 3: 2.72, 4: 2.53, 5: 2.38, 6: 2.26}
"""ln(run length) - threshold of the whiteness test by channels of a reading; constant from a run length of 1e3 on."""


def whiteness_threshold(wanted: float, dof: int) -> float:
    """Threshold of the lag-one CUSUM sum(r e e' - r^2 e'^2 / 2) with this run length in readings, r = WHITENESS."""
    return max(math.log(wanted) - WHITENESS_A.get(dof, WHITENESS_A[max(WHITENESS_A)]), 1.0)
