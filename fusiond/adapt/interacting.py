"""Interacting models of R: one filter whose noise variance is one of a ladder of levels and jumps now and then.

Between two readings the level stays with probability 1 - h and jumps with h, to level i with probability p_i. A scalar
innovation nu, of which the state's share has the variance t, makes of the weights w

    u_i ~ ((1 - h) w_i + h p_i) N(nu; 0, t + R_i),    v1 = sum u_i / (t + R_i),    v2 = sum u_i / (t + R_i)^2,

and the mixture of the updates by every level, matched in its first two moments, is

    x <- x + P H' v1 nu,    P <- P - P H' H P (v1 - (v2 - v1^2) nu^2):

an ordinary update with R = 1 / v1 - t, and the rank-one spread P H' H P (v2 - v1^2) nu^2 of the levels' means.

Source: first-order generalised pseudo-Bayes (GPB1), Bar-Shalom, Li & Kirubarajan 2001, section 11.6.4; Blom &
Bar-Shalom 1988 for its interacting form (`fusiond.adapt.bins`).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.numerics.kernel import kernel


@kernel
def likelihoods(
    weights: Any, level: Any, jump: Any, first: int, last: int, hazard: float, square: float, through: float,
    shift: float, likely: Any, sums: Any,
) -> None:  # fmt: skip
    """Weigh the levels first <= i < last by a reading: u_i into likely, the sums of
    u_i (1, 1/S_i, 1/S_i^2, R_i) into sums[0:4].

    Args:
        weights: (l,) before the reading.   jump: (l,) where a jump leads.   hazard: its probability.
        square: nu^2.   through: t.   shift: added to every exponent, against underflow; nothing else depends on it.
    """
    for k in range(4):
        sums[k] = 0.0
    for i in range(first, last):
        over = 1.0 / (through + level[i])
        u = (
            ((1.0 - hazard) * weights[i] + hazard * jump[i])
            * np.exp(shift - 0.5 * square * over)
            * np.sqrt(over)
        )
        likely[i] = u
        sums[0] += u
        sums[1] += u * over
        sums[2] += u * over * over
        sums[3] += u * level[i]


@kernel
def unweighed(
    weights: Any, level: Any, first: int, last: int, through: float, likely: Any, sums: Any
) -> None:
    """As `likelihoods`, of a reading that says nothing: the weights stay, no level jumps."""
    for k in range(4):
        sums[k] = 0.0
    for i in range(first, last):
        over = 1.0 / (through + level[i])
        likely[i] = weights[i]
        sums[0] += weights[i]
        sums[1] += weights[i] * over
        sums[2] += weights[i] * over * over
        sums[3] += weights[i] * level[i]


@kernel
def spread_of(sums: Any) -> float:
    """v2 - v1^2, never negative."""
    v1 = sums[1] / sums[0]
    return max(sums[2] / sums[0] - v1 * v1, 0.0)


@kernel
def begin(memory: Any, noise: Any, sensor: int, channel: int, ratio: float) -> None:
    """Begin with the most weight next to `ratio`, less by the square of the factor on either side of it."""
    total = 0.0
    for i in range(memory.shape[0]):
        off = max(noise.level[i] / ratio, ratio / noise.level[i])
        memory[i] = 1.0 / (off * off) if noise.jump[sensor, channel, i] > 0.0 else 0.0
        total += memory[i]
    for i in range(memory.shape[0]):
        memory[i] /= total


@kernel
def weigh(
    memory: Any, noise: Any, sensor: int, channel: int, before: float, nu: float, through: float, said: Any
) -> None:
    """Take one scalar reading into account.

    Args:
        memory: (l,) weights of the levels.   before: the ratio of this reading's R to the declared one.
        nu, through: innovation, in declared deviations, and t, in declared variances.
        said: (4,) output: R for this update, R for the next (the weights' mean), what is added, over P H' H P.
    """
    last, square = noise.level.shape[0], nu * nu
    shift = 0.5 * square / (through + noise.level[last - 1])
    likelihoods(
        memory, noise.level, noise.jump[sensor, channel], 0, last, noise.hazard, square, through, shift, memory, said
    )  # fmt: skip
    total, v1, spread = said[0], said[1] / said[0], spread_of(said)
    for i in range(last):
        memory[i] /= total
    said[0], said[1], said[2] = 1.0 / v1 - through, said[3] / total, spread * square
