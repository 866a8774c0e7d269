"""Which fault sizes the bank looks for: a ladder from what one reading shows to what the longest wait shows.

A constant fault of size theta has left theta^2 a(n) / 2 of information after n readings, a(n) summed over its running
signature, and is found when that reaches about the logarithm of the tests' run length. So each delay n has its size,

    theta(n) = sqrt(2 ln(run length) / a(n)),

and a ladder of factor two between theta(LONGEST) and theta(1) leaves no size more than a factor sqrt(2) from a cell.
On white residuals (a = n) that is d = 0.13, 0.27, 0.54, 1.1, 2.1, 4.3 at 1e5 readings. Where the information is finite
(a fault that the state learns: a position sensor's bias under constant velocity) theta(n) stops falling; the ladder
then begins below that floor, since a size is found now and then below it, and its steps are closer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fusiond.faults.course import Curve
from fusiond.numerics.ud import Vector

LONGEST = 1280
"""Readings of the sensor beyond which no fault is waited for."""
MOST = 6
"""Sizes of one suspect at most; where the ladder would be longer its factor grows."""
BELOW = 0.65
"""Smallest size of the ladder over the smallest reliably found, where the information is finite."""
STEP, FINITE_STEP = 2.0, 1.5
"""Ratio of neighbouring sizes. With finite information one more size costs little: sizes that a bank of 1.5 finds with
probability 0.5 and 0.9 are 1.05 and 1.02 times the oracle's, of 2 they are 1.06 and 1.05 (constant velocity)."""
SATURATED = 1.5
"""The information is finite where eight times the readings bring less than this factor."""
NEARLY_ALL = 0.98
"""Share of a finite information after which a signature starts anew."""
WAITS = 8
"""A signature that does not fade starts anew after this many expected delays."""
LOW_SHARES = (0.25, 0.5)
"""Shares of the two lowest sizes, which are for drifts and very long waits: a shift four times theirs is found in 1.21
times the bound's readings, with equal shares in 1.28."""
SHORTEST_AGE = 16
"""Readings that a signature is given at least."""


@dataclass(frozen=True, slots=True)
class Ladder:
    """Sizes of one suspect, ascending, in the suspect's unit.

    Args:
        ages: readings of the suspect after which a cell of each size starts anew.
        shares: of the promise that each may use up.   finite: whether the information is.
    """

    sizes: Vector
    ages: Vector
    shares: Vector
    finite: bool


def cumulative(curve: Curve, readings: int) -> Vector:
    """(readings,) information of a unit fault after 1, 2, ... own readings; the settled rate beyond the curve's end."""
    known = curve.per_reading()[:-1] if len(curve.per_reading()) > 1 else curve.per_reading()
    every = np.full(readings, curve.steady)
    every[: len(known)] = known[:readings]
    return np.cumsum(every)


def delay_of(a: Vector, size: float, log_run: float) -> float:
    """Readings after which a fault of this size has shown log_run of information; infinite where it never does."""
    n = int(np.searchsorted(a, 2.0 * log_run / (size * size)))
    return float(n + 1) if n < len(a) else math.inf


def ladder(curve: Curve, run: float, blind: float = 0.0) -> Ladder:
    """Sizes and ages for one suspect.

    Args:
        run: wanted readings between two false alarms of one cell.   blind: sizes up to this are no fault;
            the smallest looked for is twice as large.
    """
    log_run = math.log(run)
    longest = int(min(LONGEST, max(run / 30.0, 8.0)))
    a = cumulative(curve, longest)
    if a[-1] <= 0.0:
        return Ladder(np.zeros(0), np.zeros(0), np.zeros(0), True)
    finite = bool(curve.steady <= 0.0 or a[-1] < SATURATED * a[(longest - 1) // 8])
    lowest = math.sqrt(2.0 * log_run / a[-1]) * (BELOW if finite else 1.0)
    first = a[0] if a[0] > 0.0 else a[np.argmax(a > 0.0)]
    highest = max(math.sqrt(2.0 * log_run / first), lowest)
    lowest, highest = max(lowest, 2.0 * blind), max(highest, 4.0 * blind)
    lowest = min(lowest, highest)
    step = FINITE_STEP if finite else STEP
    # the last step up is taken only where it would be more than half a step
    count = min(max(1, 1 + math.floor(math.log(highest / lowest) / math.log(step) + 0.5)), MOST)
    factor = max(step, (highest / lowest / math.sqrt(step)) ** (1.0 / max(count - 1, 1)))
    factor = min(factor, LARGEST_FACTOR)
    sizes = lowest * factor ** np.arange(count)
    if finite:
        enough = int(np.searchsorted(a, NEARLY_ALL * a[-1])) + 1
        ages = np.full(count, max(enough, SHORTEST_AGE))
    else:
        waits = np.array([delay_of(a, float(size), log_run) for size in sizes])
        ages = np.maximum(WAITS * np.where(np.isfinite(waits), waits, longest), 4 * SHORTEST_AGE)
    shares = np.ones(count)
    if not finite:
        shares[:2] = LOW_SHARES[:count]
    return Ladder(sizes, ages.astype(float), shares, finite)


LARGEST_FACTOR = 2.5
"""Neighbouring sizes further apart leave faults between them waiting too long."""
