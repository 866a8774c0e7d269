"""What a bank of local filters really knows: the joint error covariance of all of them, and of what is fused from them.

    e_i = x - x_i,  J = E[e e'] with blocks P_ij
    predict:  J <- (I x A) J (I x A)' + (1 1') x Q            all share the process noise
    update:   e_i <- (I - M_i C_i) e_i - M_i v_i
    fused:    x = sum W_i x_i,  sum W_i = I  ->  P = W J W'

Dense algebra that shares nothing with the engine. Source: Bar-Shalom & Campo 1986.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class System:
    """x+ = A x + w, w ~ N(0, Q);  y_i = C_i x + v_i, v_i ~ N(0, R_i).   P0: (n, n) covariance before the first y."""

    A: Floats
    Q: Floats
    C: tuple[Floats, ...]
    R: tuple[Floats, ...]
    P0: Floats


@dataclass(frozen=True, slots=True)
class Known:
    """Covariances (n, n) after the last step: as the mode reports, as it is, and of the optimal filter."""

    reported: Floats
    true: Floats
    optimal: Floats

    @property
    def loss(self) -> float:
        """tr true / tr optimal, 1 at best."""
        return float(np.trace(self.true) / np.trace(self.optimal))

    @property
    def caution(self) -> float:
        """tr reported / tr true: below 1 optimistic."""
        return float(np.trace(self.reported) / np.trace(self.true))


Fuse = Callable[[list[Floats]], tuple[list[Floats], Floats]]
"""Local covariances (n, n) -> weights W_i (n, n) and the reported covariance."""


def corrected(P: Floats, C: Floats, R: Floats) -> tuple[Floats, Floats]:
    """Gain and posterior (Joseph)."""
    M = np.linalg.solve(C @ P @ C.T + R, C @ P).T
    kept = np.eye(P.shape[0]) - M @ C
    return np.asarray(M, dtype=np.float64), kept @ P @ kept.T + M @ R @ M.T


def optimal(system: System, steps: int) -> Floats:
    """The centralized covariance after `steps` updates."""
    C, R = np.vstack(system.C), np.zeros((0, 0))
    for block in system.R:
        R = np.block([[R, np.zeros((len(R), len(block)))], [np.zeros((len(block), len(R))), block]])
    P = system.P0
    for step in range(steps):
        P = system.A @ P @ system.A.T + system.Q if step else P
        P = corrected(P, C, R)[1]
    return P


def summed(covariances: list[Floats]) -> tuple[list[Floats], Floats]:
    """P^-1 = sum P_i^-1: the federated master, or the naive sum where the locals hold the whole of everything."""
    informations = [np.linalg.inv(P) for P in covariances]
    P = np.linalg.inv(sum(informations[1:], informations[0]))
    return [P @ Y for Y in informations], P


def bank(system: System, shares: Sequence[float], fuse: Fuse, steps: int) -> Known:
    """Run one filter for each sensor, each with Q and P0 over its share, never reset, and fuse after the last step."""
    n, count = system.A.shape[0], len(system.C)
    local = [system.P0 / share for share in shares]
    ones, moves = np.ones((count, count)), np.kron(np.eye(count), system.A)
    J = np.kron(ones, system.P0)
    for step in range(steps):
        if step:
            local = [system.A @ P @ system.A.T + system.Q / b for P, b in zip(local, shares, strict=True)]
            J = moves @ J @ moves.T + np.kron(ones, system.Q)
        kept, noise = np.zeros_like(J), np.zeros_like(J)
        for i, (C, R) in enumerate(zip(system.C, system.R, strict=True)):
            M, local[i] = corrected(local[i], C, R)
            at = slice(i * n, (i + 1) * n)
            kept[at, at], noise[at, at] = np.eye(n) - M @ C, M @ R @ M.T
        J = kept @ J @ kept.T + noise
    W, reported = fuse(local)
    weights = np.hstack(W)
    return Known(reported, weights @ J @ weights.T, optimal(system, steps))


def averaged(system: System, steps: int) -> Known:
    """Seed 004's averaged gain: what it reports (5-6) and what it does, both from the gains of (5-4)."""
    P = true = system.P0
    share, unit = 1.0 / len(system.C), np.eye(system.A.shape[0])
    for step in range(steps):
        if step:
            P, true = system.A @ P @ system.A.T + system.Q, system.A @ true @ system.A.T + system.Q
        gains = [corrected(P, C, R)[0] for C, R in zip(system.C, system.R, strict=True)]
        mean = sum(share * M @ C for M, C in zip(gains, system.C, strict=True))
        noise = sum(share**2 * M @ R @ M.T for M, R in zip(gains, system.R, strict=True))
        true = (unit - mean) @ true @ (unit - mean).T + noise
        P = (unit - mean) @ P
    return Known(P, true, optimal(system, steps))
