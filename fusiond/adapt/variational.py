"""Variational Bayes for R: a joint Gaussian and inverse gamma posterior, forgotten at a constant rate.

The noise variance of a channel has the density IG(a, b), R = b / a its estimate. A reading with innovation nu, of
which the state's share has the variance t, turns it into

    a <- p a + 1/2,    b <- p b + 1/2 (R nu / S)^2 + 1/2 t R / S,    S = t + R,    R = b / a,

the middle terms being residual and posterior variance of the measured quantity; three turns settle R.

Source: Sarkka & Nummenmaa 2009, IEEE T-AC 54(3), algorithm 1; scalar channels make its filter update explicit.
"""

from __future__ import annotations

from typing import Any

from fusiond.numerics.kernel import kernel

TURNS = 3
"""Fixed-point turns of one reading; a fourth changes R by less than a thousandth of its deviation."""
MEMORY = 1
"""Numbers remembered of a channel: a."""


@kernel
def settle_ratio(weight: float, scale: float, start: float, square: float, through: float) -> float:
    """R after a reading: the fixed point R = (scale + 1/2 (R nu / S)^2 + 1/2 t R / S) / weight.

    Args:
        weight: a, the reading counted.   scale: b without the reading.   start: R to begin with, positive.
        square: nu^2.   through: t >= 0; all in units of the declared variance.
    """
    ratio = start
    for _ in range(TURNS):
        share = ratio / (through + ratio)
        ratio = (scale + 0.5 * share * (share * square + through)) / weight
    return ratio


@kernel
def begin(memory: Any, noise: Any, sensor: int, channel: int, ratio: float) -> None:
    """Begin as if R = ratio had been seen for as long as is ever remembered."""
    memory[0] = 0.5 / (1.0 - noise.forget)


@kernel
def weigh(
    memory: Any, noise: Any, sensor: int, channel: int, before: float, nu: float, through: float, said: Any
) -> None:
    """Take one scalar reading into account.

    Args:
        memory: (MEMORY,) of the channel.   before: its R.   nu, through: innovation, in declared deviations, and t, in
        declared variances.
        said: (4,) output: R for this update, R for the next, what is added (nothing).
    """
    weight = noise.forget * memory[0] + 0.5
    ratio = settle_ratio(weight, noise.forget * memory[0] * before, before, nu * nu, through)
    memory[0] = weight
    said[0], said[1], said[2] = ratio, ratio, 0.0
