"""A configuration without control commands nothing. Where there is a law, `assembly` copies `steer_on.py` over this."""

from __future__ import annotations

from typing import Any

from fusiond.numerics.kernel import kernel


@kernel
def steer(track: Any, desk: Any, design: Any, now_ns: int, report: Any) -> None:
    """Compute a command when one is due."""
