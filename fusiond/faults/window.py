"""The window: what the last readings of the updating sensors were to the primary filter, one entry a reading."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.numerics.packed import packed

LOOKED = -1
"""`used` of an entry whose sensor is excluded: its reading was held against the filter and moved nothing."""
ODD = 6.0
"""A reading of an input further from its usual value than so many of its usual deviations is odd."""


def window_dtype(errors: int, payload: int, inputs: int) -> np.dtype[Any]:
    """One entry: n errors, m numbers a reading, ni inputs.

    e: innovations of the sequential scalar updates, whitened: independent N(0, 1) while nothing is wrong.
    used: 1, or 0 where the gate refused it, or LOOKED.
    root: sqrt(S) of each.   H, K: (m, n) decorrelated rows and gains of the scalar updates; K = 0 where the gate
    refused it, the gain it would have had where it was LOOKED at.
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


def believed(window: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """The window without the readings of excluded sensors, as though they had not come.

    Returns:
        its entries, the intervals before the missing ones joined to those that follow; (W,) their places in `window`.
    """
    places = np.flatnonzero(window["used"] != LOOKED)
    kept = window[places]
    for row in np.flatnonzero(np.diff(np.concatenate(([-1], places))) > 1):
        first = places[row - 1] + 1 if row else 0
        T, B = window["T"][first], window["B"][first]
        for entry in window[first + 1 : places[row] + 1]:
            T, B = entry["T"] @ T, entry["T"] @ B + entry["B"]
        kept["T"][row], kept["B"][row] = T, B
        missing = window[first : places[row] + 1]
        kept["odd"][row], kept["odd_count"][row] = (
            missing["odd"].max(axis=0),
            missing["odd_count"].sum(axis=0),
        )
    return kept, places
