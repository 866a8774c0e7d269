"""Errors of a state that is no vector, as its model says. `assembly` copies this file over `inject.py`."""

from __future__ import annotations

from typing import Any

from fusiond.numerics.kernel import kernel

from .process import add_error, error_between


@kernel
def inject(x: Any, dx: Any, design: Any) -> None:
    """x <- x [+] dx, in place."""
    add_error(x, dx, design.p)


@kernel
def settle(x: Any, U: Any, sensor: int, design: Any, work: Any) -> None:
    """x <- x [+] work.dx after an update by `sensor`; the covariance U diag(d) U' stays."""
    inject(x, work.dx, design)


@kernel
def between(x: Any, y: Any, dx: Any, design: Any) -> None:
    """Write dx with x [+] dx = y."""
    error_between(x, y, design.p, dx)
