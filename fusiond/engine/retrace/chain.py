"""The chain of transitions between two updates of the centralized filter."""

from __future__ import annotations

from typing import Any

from fusiond.engine.step.sizes import ERRORS
from fusiond.numerics.arrays import copy_matrix
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix

NOTHING = -1
"""Channels of a reading that was no update."""


@kernel
def begin_chain(work: Any) -> None:
    """Write the identity into work.pass_F."""
    for i in range(ERRORS):
        for j in range(ERRORS):
            work.pass_F[i, j] = 1.0 if i == j else 0.0


@kernel
def lengthen_chain(work: Any, F: Matrix) -> None:
    """work.pass_F <- F work.pass_F: one more interval of the centralized filter. Uses work.once."""
    for i in range(ERRORS):
        for j in range(ERRORS):
            total = 0.0
            for k in range(ERRORS):
                total += F[i, k] * work.pass_F[k, j]
            work.once[i, j] = total
    copy_matrix(work.once, work.pass_F)
