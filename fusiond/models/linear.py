"""Any linear, time-invariant model, its matrices in the configuration.

    discrete (`step_s` given):  x(k+1) = A x(k) + B u(k) + G w(k),  w ~ N(0, Q)
    continuous:                 x'     = A x    + B u    + G w,     w white with spectral density Q

A discrete model lives on multiples of its step; a stamp between two is taken to the nearest. Seed 004's model, where
noise enters through the input matrix (its equation 2-10), is G = B.
"""

from __future__ import annotations

import numpy as np

from fusiond.errors import ConfigError
from fusiond.models.contract import Process, flatten, shape_of
from fusiond.numerics.arrays import copy_matrix, copy_vector
from fusiond.numerics.discretise import van_loan
from fusiond.numerics.kernel import interpreted, kernel
from fusiond.numerics.ud import Matrix, Vector, ud_factor
from fusiond.types import Slot

Rows = list[list[float]]


def describe(
    *,
    states: list[str],
    A: Rows,
    G: Rows,
    Q: Rows,
    B: Rows | None = None,
    inputs: list[str] | None = None,
    step_s: float = 0.0,
) -> Process:
    """Describe the model.

    Args:
        states, inputs: names.   A: n x n.   B: n x number of inputs.   G: n x k.   Q: k x k, semi-definite.
        step_s: the step of a discrete model; 0 for continuous time.
    """
    n, driven = len(states), inputs or []
    shape_of("A", A, n, n)
    noises = shape_of("G", G, n)[1]
    shape_of("Q", Q, noises, noises)
    if driven:
        shape_of("B", B or [], n, len(driven))
    U, d = np.eye(noises), np.zeros(noises)
    if not interpreted(ud_factor)(np.array(Q, dtype=float), U, d, 1e-12):
        raise ConfigError(f"Q: {Q} is not positive semi-definite; check its signs and symmetry")
    header = (step_s, float(noises), float(len(driven)))
    matrices = flatten(A) + tuple((np.array(G, dtype=float) @ np.triu(U)).ravel().tolist()) + flatten(B or [])
    return Process(
        states=tuple(Slot(name) for name in states),
        inputs=tuple(Slot(name) for name in driven),
        noises=noises if step_s > 0.0 else n,
        parameters=header + matrices + tuple(d),
        linear=True,
        step_s=step_s,
    )


@kernel
def rows_of(p: Vector, M: Matrix) -> None:
    """Write M from the leading numbers of p, its rows one after the other."""
    for i in range(M.shape[0]):
        for j in range(M.shape[1]):
            M[i, j] = p[i * M.shape[1] + j]


@kernel
def discretise(dt_s: float, p: Vector, F: Matrix, B: Matrix, c: Vector, G: Matrix, q: Vector) -> None:
    """One step of a discrete model (dt_s is then its step), or Van Loan's integral over dt_s."""
    n, k, m = F.shape[0], int(p[1]), int(p[2])
    A, G_c, B_c = np.zeros((n, n)), np.zeros((n, k)), np.zeros((n, m))
    rows_of(p[3:], A)
    rows_of(p[3 + n * n :], G_c)
    rows_of(p[3 + n * (n + k) :], B_c)
    w = p[3 + n * (n + k + m) :]
    if p[0] > 0.0:
        copy_matrix(A, F)
        copy_matrix(B_c, B)
        copy_matrix(G_c, G)
        copy_vector(w[:k], q)
        return
    density = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            for noise in range(k):
                density[i, j] += G_c[i, noise] * w[noise] * G_c[j, noise]
    F_d, B_d, Q_d = van_loan(A, B_c, density, dt_s)
    copy_matrix(F_d, F)
    copy_matrix(B_d, B)
    ud_factor(Q_d, G, q, 1e-9)
    for i in range(n):
        for j in range(i):
            G[i, j] = 0.0
