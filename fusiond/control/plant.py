"""The plant a regulator is designed for: sampled once a command, commands that have not acted yet among its states.

    z = (x, u(k-D), ..., u(k-1)),   z+ = F z + B u(k) + w,   w ~ N(0, diag(W, 0)),   cost (z, u)' cost (z, u)

A delay of whole periods only moves the queue. With a rest of a period, the command before acts until the rest has
passed: the period is sampled in two pieces.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fusiond.errors import ConfigError
from fusiond.numerics.riccati import Matrix, hold, symmetric

SHORTEST = 1e-6
"""A rest of the delay below this share of a period is none."""


@dataclass(frozen=True, slots=True)
class Plant:
    """A sampled plant.

    Args:
        F: (N, N).   B: (N, m).   cost: (N + m, N + m).   states: n, leading ones of N that are the plant's own.
        queue: D, commands kept.   W: (n, n) process noise of one period.   period_s: time between commands.
        bare: F (n, n) and B (n, m) of the plant without its queue.
    """

    F: Matrix
    B: Matrix
    cost: Matrix
    states: int
    queue: int
    W: Matrix
    period_s: float
    bare: tuple[Matrix, Matrix]

    @property
    def controls(self) -> int:
        """m."""
        return self.B.shape[1]

    @property
    def noise(self) -> Matrix:
        """(N, N): nothing disturbs the queue."""
        whole = np.zeros_like(self.F)
        whole[: self.states, : self.states] = self.W
        return whole


@dataclass(frozen=True, slots=True)
class Plan:
    """A plant with its regulator.

    Args:
        states: names of the plant's own states.   tracked: those that follow the reference.
        disturbances: states that nothing controls, and E (n, k): how they move the plant in one period.
        K, S: feedback gain (m, N) and cost still to come (N, N), of deviations from the targets.
        targets: (n + m, r + k + 1), states and command at rest by (reference, disturbances, 1).
        L: (m, r) gain on the integral of what is tracked; (m, 0) without.   N counts the integrals, at the end.
    """

    plant: Plant
    states: tuple[str, ...]
    tracked: tuple[str, ...]
    disturbances: tuple[str, ...]
    E: Matrix
    K: Matrix
    S: Matrix
    targets: Matrix
    L: Matrix


def parts(delay_s: float, period_s: float) -> tuple[int, float]:
    """Whole periods of the delay, and what is left of it, s."""
    whole = math.floor(delay_s / period_s + SHORTEST)
    rest_s = delay_s - whole * period_s
    return whole, rest_s if rest_s > SHORTEST * period_s else 0.0


def queued(F: Matrix, B: Matrix, cost: Matrix, W: Matrix, periods: int, period_s: float) -> Plant:
    """A plant sampled already, its command delayed by whole periods; cost: (n + m, n + m) of x and what acts."""
    return _with_queue((F, np.zeros_like(B), B), cost_by_turns(cost, B.shape[1]), W, periods, 0, period_s)


def cost_by_turns(cost: Matrix, m: int) -> Matrix:
    """The cost of (x, u) as one of (x, the command before, u): nothing acts but u."""
    n = len(cost) - m
    whole = np.zeros((n + 2 * m, n + 2 * m))
    keep = [*range(n), *range(n + m, n + 2 * m)]
    whole[np.ix_(keep, keep)] = cost
    return whole


def sampled(A: Matrix, B: Matrix, density: Matrix, W: Matrix, period_s: float, delay_s: float) -> Plant:
    """A continuous plant x' = A x + B u, its cost density (x, u)' density (x, u), its command late by delay_s.

    Source: Astrom and Wittenmark, Computer-Controlled Systems, section 2.3. Law: tests/laws/test_regulator.py.
    """
    n, m = B.shape
    periods, rest_s = parts(delay_s, period_s)
    begin, end = np.eye(n + 2 * m), np.eye(n + 2 * m)
    before, after = hold(A, B, density, rest_s), hold(A, B, density, period_s - rest_s)
    was, now = [*range(n + m)], [*range(n), *range(n + m, n + 2 * m)]
    begin[:n, :n], begin[:n, n : n + m] = before[0], before[1]
    end[:n, :n], end[:n, n + m :] = after[0], after[1]
    whole = np.zeros((n + 2 * m, n + 2 * m))
    whole[np.ix_(was, was)] = before[2]
    later = np.zeros_like(whole)
    later[np.ix_(now, now)] = after[2]
    whole = symmetric(whole + begin.T @ later @ begin)
    through = end @ begin
    moves = through[:n, :n], through[:n, n : n + m], through[:n, n + m :]
    return _with_queue(moves, whole, W, periods, int(rest_s > 0.0), period_s)


def _with_queue(
    moves: tuple[Matrix, Matrix, Matrix], cost: Matrix, W: Matrix, periods: int, rest: int, period_s: float
) -> Plant:
    """moves: F, and what the command before and the one now acting do; cost: of the three."""
    F, before, acting = moves
    n, m = acting.shape
    D = periods + rest
    N = n + D * m
    pick = np.zeros((n + 2 * m, N + m))
    pick[:n, :n] = np.eye(n)
    if rest:
        pick[n : n + m, n : n + m] = np.eye(m)
    # what acts now: the oldest command that is not the one before; without a queue the new one
    at = n + rest * m
    pick[n + m :, at : at + m] = np.eye(m)
    whole = np.zeros((N, N + m))
    whole[:n] = np.hstack([F, before, acting]) @ pick
    for place in range(D):
        row, column = n + place * m, n + (place + 1) * m
        whole[row : row + m, column : column + m] = np.eye(m)
    return Plant(
        whole[:, :N], whole[:, N:], symmetric(pick.T @ cost @ pick), n, D, W, period_s, (F, before + acting)
    )


def targets(plant: Plant, C: Matrix, E: Matrix, rest: Matrix) -> Matrix:
    """(n + m, r + k + 1): where states and command rest, by (reference, disturbances, 1).

    [[F - I, B], [C, 0]] (xs, us - rest) = (-E d, reference), solved by least squares where it is not square.

    Args:
        C: (r, n), what follows the reference.   E: (n, k), of disturbances.   rest: (m,), the command that holds the
            plant still.
    Raises: ConfigError where the plant cannot rest at an arbitrary reference.
    """
    F, B = plant.bare
    n, m = B.shape
    r, k = len(C), E.shape[1]
    M = np.block([[F - np.eye(n), B], [C, np.zeros((r, m))]])
    right = np.block([[np.zeros((n, r)), -E], [np.eye(r), np.zeros((r, k))]])
    solution = np.linalg.lstsq(M, right, rcond=None)[0]
    if np.abs(M @ solution - right).max(initial=0.0) > 1e-8:
        raise ConfigError(
            "tracks: the plant cannot rest where the reference or a disturbance wants it; track other states, no more "
            "than there are controls"
        )
    return np.hstack([solution, np.concatenate([np.zeros(n), rest])[:, None]])
