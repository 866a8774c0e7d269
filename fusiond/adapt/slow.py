"""The slow R, the scale of the monitors: variational Bayes over hundreds of readings, the innovation's mean removed.

A bias raises the mean square of the innovations as noise does; what is measured here is their scatter about their own
slow mean, so that a fault cannot widen the scale it is judged by.
"""

from __future__ import annotations

from fusiond.adapt.variational import settle_ratio
from fusiond.numerics.kernel import kernel

LARGEST = 3.0
"""An innovation this many deviations from its mean, or more, counts as this: a jump is for the monitors to find."""
CLIPPED = 0.995007
"""Mean square of a normal number whose size is limited to LARGEST."""


@kernel
def slow_ratio(
    ratio: float, weight: float, forget: float, nu: float, mean: float, share: float, through: float
) -> float:
    """R after one more reading.

    Args:
        ratio, weight: R and a before.   nu: innovation.   mean: its slow mean before this reading, of which a reading
        is `share`.   through: variance of the state's share in nu.   All in units of the declared variance.
    """
    S = through + ratio
    widened = 1.0 + share / (2.0 - share)  # the mean is known no better than its readings allow
    square = min((nu - mean) * (nu - mean) / widened, LARGEST * LARGEST * S) / CLIPPED
    return settle_ratio(forget * weight + 0.5, forget * weight * ratio, ratio, square, through)


@kernel
def slow_start(forget: float) -> float:
    """The weight of a ratio believed as if it had been seen for as long as is ever remembered."""
    return 0.5 / (1.0 - forget)
