"""Process model of the template: a scalar random walk."""

from __future__ import annotations

from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector


@kernel
def discretise(dt_s: float, p: Vector, F: Matrix, B: Matrix, c: Vector, G: Matrix, q: Vector) -> None:
    """x' = white noise of spectral density p[0]."""
    F[0, 0] = 1.0
    G[0, 0] = 1.0
    q[0] = p[0] * dt_s


@kernel
def add_error(x: Vector, dx: Vector, p: Vector) -> None:
    """x <- x + dx, in place; only models whose state is no vector need this."""
    x[0] += dx[0]


@kernel
def error_between(x: Vector, y: Vector, p: Vector, dx: Vector) -> None:
    """Write dx with x + dx = y; only models whose state is no vector need this."""
    dx[0] = y[0] - x[0]


@kernel
def turn_error(x: Vector, dx: Vector, p: Vector, J: Matrix) -> None:
    """x <- x + dx; only models whose vectors turn with the heading need this, and write J."""
    x[0] += dx[0]
