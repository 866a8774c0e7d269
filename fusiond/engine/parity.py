"""A local filter beside the centralized one, and how far they may differ.

The centralized filter hears all that a local one hears, from the same start. Where it is optimal its error is
uncorrelated with whatever it could have been told by the local one, so that

    Cov(x_local - x) = P_local - P,

which is small where one sensor alone already tells nearly all. Where that variance is not positive (rounding, or a
linearisation at two different points), or the fusion is no optimal one, the deviation is bounded whatever the
correlation by sqrt(P_local) + sqrt(P).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.engine import Engine
from fusiond.numerics.discretise import wrap_angle

Vector = NDArray[np.float64]
EXACT = ("", "information_sum")
"""Topologies whose estimate is that of the centralized filter; empty: the compiled step."""
ROUNDING = 1e-9
"""Part of a local variance below which its difference to the centralized one is rounding."""


@dataclass(frozen=True, slots=True)
class Local:
    """One local filter now.

    Args:
        t_ns: its time, the stamp of its sensor's newest reading.   x: (states,).   std: (errors,).
        parity: (k,) x_local - x of the states that have a variance of their own, in the order of `Engine.layout.
            errors`; None where the centralized filter is already at another time.
        parity_std: (k,).   bounded: (k,) whether parity_std is the bound instead of the deviation.
    """

    t_ns: int
    x: Vector
    std: Vector
    parity: Vector | None
    parity_std: Vector
    bounded: NDArray[np.bool_]


def shared_slots(engine: Engine) -> list[tuple[int, int]]:
    """Places (in x, in the error) of every state that is its own error: all but a quaternion's."""
    states = {slot.name: i for i, slot in enumerate(engine.layout.states)}
    return [(states[slot.name], k) for k, slot in enumerate(engine.layout.errors) if slot.name in states]


def local_estimate(engine: Engine, row: int) -> Local:
    """The filter in that row of the bank, and its parity to row 0.

    Args:
        row: of `engine.layout.filters`, a filter that hears one sensor.
    """
    track = engine.track[0]
    local_var, central_var = np.diagonal(engine.covariance(row)), np.diagonal(engine.covariance())
    places = shared_slots(engine)
    in_x, in_error = [i for i, _ in places], [k for _, k in places]
    parity = None
    if track["filter_t_ns"][row] == track["filter_t_ns"][0]:
        apart = track["x"][row][in_x] - track["x"][0][in_x]
        angles = engine.angles[in_x]
        parity = np.array([wrap_angle(a) if angle else a for a, angle in zip(apart, angles, strict=True)])
    mine, all_of_them = local_var[in_error], central_var[in_error]
    difference = mine - all_of_them
    bounded = ~(difference > ROUNDING * mine) | (engine.layout.topology not in EXACT)
    std = np.sqrt(np.where(bounded, (np.sqrt(mine) + np.sqrt(all_of_them)) ** 2, difference))
    return Local(
        int(track["filter_t_ns"][row]), np.array(track["x"][row]), np.sqrt(local_var), parity, std, bounded
    )
