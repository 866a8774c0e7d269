"""No protection levels. `assembly` copies `protect_on.py` over this file where they are asked for."""

from __future__ import annotations

from typing import Any

from fusiond.numerics.kernel import kernel


@kernel
def protect(track: Any, design: Any, work: Any, report: Any) -> None:
    """The report of a reading or tick is about to be completed from the track."""
