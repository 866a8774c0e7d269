"""The guards of every estimate of noise: between floor and ceiling, and no faster than allowed."""

from __future__ import annotations

import numpy as np

from fusiond.numerics.kernel import kernel


@kernel
def held(ratio: float, before: float, floor: float, ceiling: float, most: float) -> float:
    """The ratio, at most a factor exp(most) from the one before, within floor and ceiling; what is no number: before.

    Args:
        ratio: R / declared as estimated.   before: as it was, positive.
    """
    if not ratio > 0.0 or not np.isfinite(ratio):
        return before
    step = np.exp(most)
    ratio = min(max(ratio, before / step), before * step)
    return float(min(max(ratio, floor), ceiling))
