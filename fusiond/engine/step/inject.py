"""Errors of a state that is a vector, angles kept on the circle."""

from __future__ import annotations

from typing import Any

from fusiond.numerics.discretise import wrap_angle
from fusiond.numerics.kernel import kernel

from .sizes import STATES


@kernel
def inject(x: Any, dx: Any, design: Any) -> None:
    """x <- x + dx, in place."""
    for i in range(STATES):
        x[i] += dx[i]
        if design.angle[i]:
            x[i] = wrap_angle(x[i])


@kernel
def settle(x: Any, U: Any, sensor: int, design: Any, work: Any) -> None:
    """x <- x [+] work.dx after an update by `sensor`; the covariance U diag(d) U' stays."""
    inject(x, work.dx, design)


@kernel
def between(x: Any, y: Any, dx: Any, design: Any) -> None:
    """Write dx with x + dx = y."""
    for i in range(STATES):
        dx[i] = y[i] - x[i]
        if design.angle[i]:
            dx[i] = wrap_angle(dx[i])
