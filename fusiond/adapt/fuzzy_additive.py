"""The published fuzzy design, for comparison: the degree of matching moves R by addition.

    DoM = mean (t + R) - mean nu^2,    R <- R + table(DoM),

over the window of `fusiond.adapt.fuzzy`: where innovations scatter less than expected (DoM > 0) R falls by a fixed
amount, where more it rises. In units of the declared variance, so that its sets mean the same everywhere. It can step
below zero, where the floor of every method holds it, and its steps suit one size of noise only.

Source: Escamilla-Ambrosio & Mort 2003, adaptation of R by covariance matching.
"""

from __future__ import annotations

from typing import Any

from fusiond.adapt.fuzzy import begin, look_up, note
from fusiond.numerics.kernel import kernel

__all__ = ["begin", "weigh"]


@kernel
def weigh(
    memory: Any, noise: Any, sensor: int, channel: int, before: float, nu: float, through: float, said: Any
) -> None:
    """Take one scalar reading into account; arguments as in `fusiond.adapt.fuzzy`."""
    ratio = before
    if note(memory, noise.window, nu, nu * nu, through):
        ratio = max(before + look_up(noise, memory[3] + before - memory[2], 0.0), 1e-12)
    said[0], said[1], said[2] = ratio, ratio, 0.0
