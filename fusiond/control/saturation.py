"""What a command may be: limits, the fastest change, and the fade after a switch of the estimate."""

from __future__ import annotations

from fusiond.numerics.kernel import kernel


@kernel
def limited(u: float, lowest: float, highest: float) -> float:
    """u, no lower and no higher."""
    return min(max(u, lowest), highest)


@kernel
def slewed(u: float, last: float, most: float) -> float:
    """u, no further from the last command than `most` (infinite: as far as it likes)."""
    return min(max(u, last - most), last + most)


@kernel
def left_of_fade(since_ns: int, fade_ns: int) -> float:
    """Share of the bump that is still taken off the command, 1 at the switch and 0 after the fade."""
    if since_ns < 0 or since_ns >= fade_ns:
        return 0.0
    return 1.0 - since_ns / fade_ns
