"""The kernels of every designed law: u = us - K (z - zs) - L q, z = (x, queue), and what that costs.

    (xs, us)  where the plant rests at the reference, disturbances as estimated and the feedforward taken into account
    q         integrals of what is tracked, minus its reference; q+ = q + period (C x - reference) + Y (done - wanted)

Their parameters c are laid out by `designing.flat`: header (n, m, r, k, D, q, period), K (m, N), targets (n + m, r + k
+ 1), cost (N + m, N + m), L (m, q), Y (q, m), places of the integrated states (q), with N = n + D m.
"""

from __future__ import annotations

from typing import Any

from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Vector

HEADER = 7


@kernel
def target(x: Vector, desk: Any, at: Vector, c: Vector, row: int) -> float:
    """Where state `row` rests (row < n), or command row - n."""
    n, m, r, k, D = int(c[0]), int(c[1]), int(c[2]), int(c[3]), int(c[4])
    base = HEADER + m * (n + D * m) + row * (r + k + 1)
    total = c[base + r + k]
    for i in range(r):
        total += c[base + i] * desk.reference[i]
    for i in range(k):
        total += c[base + r + i] * x[at[n + i]]
    return total


@kernel
def deviation(x: Vector, desk: Any, at: Vector, c: Vector, place: int) -> float:
    """How far number `place` of z is from rest."""
    n, m = int(c[0]), int(c[1])
    if place < n:
        return x[at[place]] - target(x, desk, at, c, place)
    turn, i = (place - n) // m, (place - n) % m
    return desk.queue[turn, i] - target(x, desk, at, c, n + i)


@kernel
def feed_back(x: Vector, desk: Any, at: Vector, c: Vector, u: Vector) -> None:
    """Write us - K (z - zs)."""
    n, m, D = int(c[0]), int(c[1]), int(c[4])
    N = n + D * m
    for i in range(m):
        u[i] = target(x, desk, at, c, n + i)
    for j in range(N):
        off = deviation(x, desk, at, c, j)
        for i in range(m):
            u[i] -= c[HEADER + i * N + j] * off


@kernel
def quadratic(x: Vector, desk: Any, at: Vector, c: Vector) -> float:
    """(z - zs, u - us)' cost (z - zs, u - us) with u = desk.command, which is not in the queue yet."""
    n, m, r, k, D = int(c[0]), int(c[1]), int(c[2]), int(c[3]), int(c[4])
    N = n + D * m
    base = HEADER + m * N + (n + m) * (r + k + 1)
    total = 0.0
    for i in range(N + m):
        left = _part(x, desk, at, c, i, N)
        if left != 0.0:
            for j in range(N + m):
                weight = c[base + i * (N + m) + j]
                if weight != 0.0:
                    total += left * weight * _part(x, desk, at, c, j, N)
    return total


@kernel
def _part(x: Vector, desk: Any, at: Vector, c: Vector, place: int, N: int) -> float:
    """Number `place` of (z - zs, u - us)."""
    if place < N:
        return deviation(x, desk, at, c, place)
    return desk.command[place - N] - target(x, desk, at, c, int(c[0]) + place - N)


@kernel
def integrals_at(c: Vector) -> int:
    """Where L begins in c."""
    n, m, r, k, D = int(c[0]), int(c[1]), int(c[2]), int(c[3]), int(c[4])
    N = n + D * m
    return HEADER + m * N + (n + m) * (r + k + 1) + (N + m) * (N + m)


@kernel
def integrate(x: Vector, desk: Any, at: Vector, c: Vector) -> None:
    """Bring the integrals to now; desk.wanted is still the last command's."""
    m, q = int(c[1]), int(c[5])
    back = integrals_at(c) + m * q
    for i in range(q):
        total = desk.memory[i] + c[6] * deviation(x, desk, at, c, int(c[back + q * m + i]))
        for j in range(m):
            total += c[back + i * m + j] * (desk.done[j] - desk.wanted[j])
        desk.memory[i] = total


@kernel
def take_off_integrals(desk: Any, c: Vector, u: Vector) -> None:
    """u <- u - L q."""
    m, q = int(c[1]), int(c[5])
    gain = integrals_at(c)
    for i in range(m):
        for j in range(q):
            u[i] -= c[gain + i * q + j] * desk.memory[j]
