"""Small charts from characters: a curve in braille dots (2 by 4 in a cell), a bar around zero."""

from __future__ import annotations

import math
from collections.abc import Sequence

DOTS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
"""Bits of the braille cell, by column and by row from the top."""
BLANK = 0x2800


def curve(
    points: Sequence[tuple[float, float]], x_end: float, y_range: tuple[float, float], width: int, height: int
) -> list[str]:
    """Points (x, y) with 0 <= x <= x_end as lines of text, the highest first; neighbours are joined."""
    rows, columns = 4 * height, 2 * width
    cells = [[0] * width for _ in range(height)]
    low, high = y_range
    before: tuple[int, int] | None = None
    for x, y in points:
        if not math.isfinite(y):
            before = None
            continue
        column = min(columns - 1, max(0, int(x / x_end * (columns - 1))))
        row = min(rows - 1, max(0, round((high - y) / (high - low) * (rows - 1))))
        first = row if before is None or before[0] < column - 1 else before[1]
        for k in range(min(first, row), max(first, row) + 1):
            cells[k // 4][column // 2] |= DOTS[column % 2][k % 4]
        before = (column, row)
    return ["".join(chr(BLANK + cell) if cell else " " for cell in line) for line in cells]


def rule(y: float, y_range: tuple[float, float], height: int) -> int:
    """The line of text on which a value stands."""
    low, high = y_range
    row = round((high - y) / (high - low) * (4 * height - 1))
    return min(height - 1, max(0, row // 4))


def deviation(value: float, limit: float, half: int = 8) -> str:
    """A value between -limit and limit as a mark on a line; beyond them, an arrow at its end."""
    cells = ["─"] * (2 * half + 1)
    cells[half] = "┼"
    place = half + round(value / limit * half) if limit > 0 and math.isfinite(value / limit) else half
    if place < 0 or place > 2 * half:
        cells[0 if place < 0 else -1] = "◀" if place < 0 else "▶"
    else:
        cells[place] = "●"
    return "".join(cells)
