"""Errors of a state some of whose vectors turn with the heading. `assembly` copies this file over `inject.py`."""

from __future__ import annotations

from typing import Any

from fusiond.numerics.kernel import kernel

from .process import add_error, error_between, turn_error
from .sizes import ERRORS


@kernel
def settle(x: Any, U: Any, sensor: int, design: Any, work: Any) -> None:
    """x <- x [+] work.dx after an update by `sensor`; U <- J U, work.J = J, what that does to the error."""
    for i in range(ERRORS):
        for j in range(ERRORS):
            work.J[i, j] = 1.0 if i == j else 0.0
    if not design.free[sensor]:
        add_error(x, work.dx, design.p)
        return
    turn_error(x, work.dx, design.p, work.J)
    for i in range(ERRORS):
        for m in range(i + 1, ERRORS):
            if work.J[i, m] != 0.0:
                U[i, m] += work.J[i, m]
                for k in range(m + 1, ERRORS):
                    U[i, k] += work.J[i, m] * U[m, k]


@kernel
def between(x: Any, y: Any, dx: Any, design: Any) -> None:
    """Write dx with x [+] dx = y."""
    error_between(x, y, design.p, dx)
