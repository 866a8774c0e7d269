"""How far a control loop is from instability: its poles, and its disk margin at the plant's input.

The disk margin alpha is the largest of which every factor in the disk with the diameter from (2 - alpha) / (2 + alpha)
to its inverse leaves the loop stable: gain and phase may be wrong together. alpha = 1 / max |S - 1/2| over all
frequencies, S = (I + L)^-1 (several commands: its largest singular value, all loops wrong at once). A regulator that is
told the state has large margins; with an estimate in between LQG promises none (Doyle 1978), so both are computed.

Source: Seiler, Packard and Gahinet 2020, "An introduction to disk margins". Law: tests/laws/test_margins.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fusiond.control.plant import Plan
from fusiond.numerics.riccati import Matrix

FREQUENCIES = 4000
"""Frequencies looked at, from LOWEST to half the rate of commands, most of them low."""
LOWEST = 1e-5


@dataclass(frozen=True, slots=True)
class DiskMargin:
    """What a loop bears.

    Args:
        alpha: the disk margin, 0 to 2.   gain: factors of the gain, alone, that it bears, at least; the upper one is
            None where there is no limit.   phase_rad: of the phase, alone, at least.
    """

    alpha: float
    gain: tuple[float, float | None]
    phase_rad: float


@dataclass(frozen=True, slots=True)
class Loop:
    """A loop opened at the plant's input: x+ = A x + B v, u = C x; closed with v = u."""

    A: Matrix
    B: Matrix
    C: Matrix

    def sensitivity(self, z: complex) -> NDArray[np.complex128]:
        """S = (I + L)^-1 with L = -C (z I - A)^-1 B."""
        L = -self.C @ np.linalg.solve(z * np.eye(len(self.A)) - self.A, self.B)
        return np.asarray(np.linalg.inv(np.eye(len(L)) + L))

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Closed."""
        return np.asarray(np.linalg.eigvals(self.A + self.B @ self.C), dtype=np.complex128)


def disk_margin(loop: Loop) -> DiskMargin:
    """The margin of a loop that is stable when closed, by its largest |S - 1/2| on a grid of frequencies."""
    angles = np.pi * np.geomspace(LOWEST, 1.0, FREQUENCIES)
    half = 0.5 * np.eye(loop.B.shape[1])
    worst = max(float(np.linalg.norm(loop.sensitivity(np.exp(1j * angle)) - half, 2)) for angle in angles)
    alpha = min(1.0 / worst, 2.0)
    most = None if alpha >= 2.0 else (2.0 + alpha) / (2.0 - alpha)
    return DiskMargin(alpha, ((2.0 - alpha) / (2.0 + alpha), most), float(2.0 * np.arctan(0.5 * alpha)))


def regulator_loop(plan: Plan) -> Loop:
    """The loop of a regulator that is told the state; queue and integrals are its own."""
    plant = plan.plant
    N, q = len(plant.F), plan.L.shape[1]
    A, B = np.zeros((N + q, N + q)), np.zeros((N + q, plant.controls))
    A[:N, :N], B[:N] = plant.F, plant.B
    A[N:, N:] = np.eye(q)
    for row, name in enumerate(plan.tracked[:q]):
        A[N + row, plan.states.index(name)] = plant.period_s
    return Loop(A, B, -np.hstack([plan.K, plan.L]))


def estimated_loop(plan: Plan, H: Matrix, M: Matrix) -> Loop:
    """The loop with the filter in it: what is commanded drives the prediction, what is perturbed the plant.

    Args:
        H: (p, n) of all readings of one period, which come when the command is computed.   M: (n, p), the filter's
            settled gain.   Both of the plant's own states.
    """
    plant = plan.plant
    n, N, m, q = plant.states, len(plant.F), plant.controls, plan.L.shape[1]
    # (z, xp, Q, i): plant with its queue, predicted state, the controller's own queue, integrals
    size = N + n + (N - n) + q
    see = np.zeros((n, size))
    see[:, :n], see[:, N : N + n] = M @ H, np.eye(n) - M @ H
    own = np.zeros((N, size))
    own[:n] = see
    own[n:, N + n : N + n + N - n] = np.eye(N - n)
    tracked = np.array([[float(name == one) for one in plan.states] for name in plan.tracked[:q]])
    after = np.zeros((q, size))
    after[:, N + n + N - n :] = np.eye(q)
    C = -plan.K @ own
    if q:
        after = after + plant.period_s * tracked.reshape(q, n) @ see
        C = C - plan.L @ after
    A, B = np.zeros((size, size)), np.zeros((size, m))
    A[:N, :N], B[:N] = plant.F, plant.B
    follow = plant.F @ own + plant.B @ C
    A[N : N + N] = follow
    A[N + N :] = after
    return Loop(A, B, C)
