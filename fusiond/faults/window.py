"""The window: what the last readings of the updating sensors were to the primary filter, one entry a reading."""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.numerics.packed import packed

ODD = 6.0
"""A reading of an input further from its usual value than so many of its usual deviations is odd."""


def window_dtype(errors: int, payload: int, inputs: int) -> np.dtype[Any]:
    """One entry: n errors, m numbers a reading, ni inputs.

    e: innovations of the sequential scalar updates, whitened: independent N(0, 1) while nothing is wrong.
    root: sqrt(S) of each.   H, K: (m, n) decorrelated rows and gains of the scalar updates; K = 0 where not used.
    D: (m, m) response of decorrelated channel c to a unit fault of raw channel k.
    own: variance of the noise itself in each, where it is estimated; 0: the gain says it.
    h, hdot: predicted raw reading, and its rate of change (1/s).
    T: (n, n) transition of the error since the entry before;   B: (n, ni) its response to a unit error of each input.
    odd, odd_count: (ni,) of each input's readings since the entry before, see `monitor_dtype`.   away: their mean
    deviation from what is usual, in the input's unit.
    """
    n, m = errors, payload
    return packed([
        ("t_ns", "<i8"), ("sensor", "<i4"), ("dof", "<i4"), ("used", "<i8"),
        ("e", "<f8", (m,)), ("root", "<f8", (m,)), ("H", "<f8", (m, n)), ("K", "<f8", (m, n)), ("D", "<f8", (m, m)),
        ("own", "<f8", (m,)),
        ("h", "<f8", (m,)), ("hdot", "<f8", (m,)), ("T", "<f8", (n, n)), ("B", "<f8", (n, inputs)),
        ("odd", "<f8", (inputs,)), ("odd_count", "<i8", (inputs,)), ("away", "<f8", (inputs,)),
    ])  # fmt: skip
