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
    weights: Any, level: Any, jump: Any, first: int, last: int, stay: float, hazard: float,
    square: float, through: float, shift: float, likely: Any,
) -> float:  # fmt: skip
    """Write u_i of the levels first <= i < last, not normalised, into likely; returns their sum.

    Args:
        weights: (l,) before the reading.   stay: probability that the level stays, times what else scales the weights.
        hazard: probability of a jump.   square: nu^2.   shift: taken off every exponent, against underflow.
    """
    total = 0.0
    for i in range(first, last):
        S = through + level[i]
        u = (stay * weights[i] + hazard * jump[i]) * np.exp(shift - 0.5 * square / S) / np.sqrt(S)
        likely[i] = u
        total += u
    return total


@kernel
def moments(likely: Any, level: Any, first: int, last: int, total: float, through: float, said: Any) -> None:
    """Write v1, v2 - v1^2 and the mean level of the weights likely / total into said[0:3]."""
    v1, v2, mean = 0.0, 0.0, 0.0
    for i in range(first, last):
        share = likely[i] / total
        over = share / (through + level[i])
        v1 += over
        v2 += over / (through + level[i])
        mean += share * level[i]
    said[0], said[1], said[2] = v1, max(v2 - v1 * v1, 0.0), mean


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
        said: (3,) output: R for this update, R for the next (the weights' mean), variance added over (P H' H P).
    """
    last, square = noise.level.shape[0], nu * nu
    shift = 0.5 * square / (through + noise.level[last - 1])
    total = likelihoods(
        memory, noise.level, noise.jump[sensor, channel], 0, last, 1.0 - noise.hazard, noise.hazard,
        square, through, shift, memory,
    )  # fmt: skip
    moments(memory, noise.level, 0, last, total, through, said)
    for i in range(last):
        memory[i] /= total
    v1, spread, mean = said[0], said[1], said[2]
    said[0], said[1], said[2] = 1.0 / v1 - through, mean, spread * square
