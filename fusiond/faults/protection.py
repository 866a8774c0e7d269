"""Protection levels: how wrong an output may be although no fault has been named.

Whichever one sensor i is wrong, the filter that never heard it is right: its error is N(0, P_-i). The published
estimate differs from it by the known separation d_i = x - x_-i, so for an output y = c'x

    |error of y| <= |c'd_i| + |error of c'x_-i|,     PL = max(K sigma, max_i (|c'd_i| + K sigma_-i)),

with sigma^2 = c'P c, sigma_-i^2 = c'P_-i c, and K the two-sided normal quantile of the promised share. With no fault,
and with any fault of any one sensor, the output lies outside with at most that probability. The separation itself
stands where ARAIM's solution separation puts the largest that could go undetected, so nothing is assumed of detection.

Source: the triangle inequality. Test: tests/calibration/test_protection.py.
"""

from __future__ import annotations

import numpy as np
from scipy.special import ndtri

from fusiond.numerics.ud import Matrix, Vector


def quantile(outside: float) -> float:
    """K with P(|z| > K) = outside for a standard normal z; 0 < outside < 1."""
    return float(-ndtri(0.5 * outside))


def protection_levels(
    outside: float, outputs: Matrix, P: Matrix, separations: Matrix, P_without: Matrix
) -> Vector:
    """(q,) the level of each output, in its unit.

    Args:
        outside: promised largest share of samples whose error exceeds the level.   outputs: (q, n) rows c'.
        P: (n, n) of the published estimate.   separations: (s, n) published estimate less that without sensor i, as
            errors of the state (angles on the circle).   P_without: (s, n, n). Sensors without which nothing would be
            observed belong in it too: their huge P is what makes the level honest.
    """
    K = quantile(outside)
    own = K * np.sqrt(np.maximum(np.einsum("qi,ij,qj->q", outputs, P, outputs), 0.0))
    if not len(separations):
        return own
    sigma = np.sqrt(np.maximum(np.einsum("qi,sij,qj->sq", outputs, P_without, outputs), 0.0))
    return np.maximum(own, np.max(np.abs(separations @ outputs.T) + K * sigma, axis=0))
