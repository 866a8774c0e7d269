"""Fuzzy R: rules on how innovations scatter, and whether they have a mean, read from a table made at design time.

Over a window of N readings (exponential weights of that length) the mean square of the innovations is compared with
what is expected of it, and their mean with their own scatter:

    delta = ln(mean nu^2 / mean (t + R)),    m = |mean nu| sqrt(N / mean nu^2),    ln R <- ln R + table(delta, m).

The rules and their evaluation are `fusiond.adapt.fuzzy_design`'s. m is a t statistic, not |mean| sqrt(N / S): against
the expected S a rise of the noise alone would look like a mean, and hold adaptation back when it is needed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.numerics.kernel import kernel

MEMORY = 4
"""Numbers remembered of a channel: readings seen, mean of nu, of nu^2, and of t."""


@kernel
def place_in(at: Any, value: float) -> int:
    """The interval of increasing points (k,) that holds the value, or the nearest one."""
    low, high = 0, at.shape[0] - 1
    while high - low > 1:
        middle = (low + high) // 2
        if value < at[middle]:
            high = middle
        else:
            low = middle
    return low


@kernel
def look_up(noise: Any, row: float, column: float) -> float:
    """The table at (row, column), bilinear between its points, inputs limited to its edges."""
    i, j = place_in(noise.row_at, row), place_in(noise.column_at, column)
    y = (row - noise.row_at[i]) / (noise.row_at[i + 1] - noise.row_at[i])
    x = (column - noise.column_at[j]) / (noise.column_at[j + 1] - noise.column_at[j])
    y, x = min(max(y, 0.0), 1.0), min(max(x, 0.0), 1.0)
    low = (1.0 - x) * noise.table[i, j] + x * noise.table[i, j + 1]
    high = (1.0 - x) * noise.table[i + 1, j] + x * noise.table[i + 1, j + 1]
    return float((1.0 - y) * low + y * high)


@kernel
def note(memory: Any, window: float, nu: float, square: float, through: float) -> bool:
    """Move the window on by one reading; False while it is not full."""
    memory[0] = min(memory[0] + 1.0, 1e6)
    share = max(1.0 / memory[0], 2.0 / (window + 1.0))
    memory[1] += share * (nu - memory[1])
    memory[2] += share * (square - memory[2])
    memory[3] += share * (through - memory[3])
    return bool(memory[0] >= window and memory[2] > 0.0)


@kernel
def begin(memory: Any, noise: Any, sensor: int, channel: int, ratio: float) -> None:
    """Begin with an empty window."""
    for i in range(MEMORY):
        memory[i] = 0.0


@kernel
def weigh(
    memory: Any, noise: Any, sensor: int, channel: int, before: float, nu: float, through: float, said: Any
) -> None:
    """Take one scalar reading into account.

    Args:
        memory: (MEMORY,) of the channel.   before: its R.   nu, through: innovation and variance of the state's share,
        in declared deviations.   said: (4,) output: R for this update, R for the next, what is added (nothing).
    """
    square, ratio = nu * nu, before
    if note(memory, noise.window, nu, square, through):
        delta = np.log(memory[2] / (memory[3] + before))
        off = abs(memory[1]) * np.sqrt(noise.window / memory[2])
        ratio = before * np.exp(look_up(noise, delta, off))
    said[0], said[1], said[2] = ratio, ratio, 0.0
