"""One interval of a nonlinear model, its F kept. `assembly` copies this file as `advance.py`."""

from __future__ import annotations

from typing import Any

from fusiond.engine.records import CENTRAL
from fusiond.engine.step.advance import advance as advance_only
from fusiond.numerics.kernel import kernel

from .chain import lengthen_chain


@kernel
def advance(track: Any, design: Any, work: Any, row: int, dt_ns: int) -> None:
    """Predict filter `row` over one interval; of the centralized one, lengthen the chain."""
    advance_only(track, design, work, row, dt_ns)
    if row == CENTRAL:
        lengthen_chain(work, work.F)
