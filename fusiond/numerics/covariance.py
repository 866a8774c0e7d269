"""The guard of a covariance that its recursion does not keep sound: watched, repaired by policy, every repair measured.

Everything is judged in unit-free coordinates, C = P_ij / (s_i s_j) with s_i^2 = |P_ii|, so that nanometres and
gigametres are treated alike. Every policy only ever adds: P_repaired - P is positive semi-definite, so that no
repair makes a filter surer of anything than it was, a well-observed direction least of all.

    policy        what it adds
    seed          diag(|o_i|), o_i ~ N(0, small): seed 004, figure 3-1; absolute, so it may be too small or too large
    shift         the same share of each variance: delta diag(s^2), just enough
    eigen_floor   variance in the unsound directions only: eigenvalues of C raised to FLOOR
    restore       P(before) + the positive part of P - P(before): the last sound covariance, and what has grown since
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusiond.numerics.ud import Matrix, Vector

ROUNDING = 1e-12
"""Asymmetry, and negative eigenvalues of C relative to its largest, up to here are rounding."""
FLOOR = 1e-12
"""Smallest eigenvalue of C that a repair leaves, relative to the largest."""
POLICIES = ("seed", "shift", "eigen_floor", "restore")


@dataclass(frozen=True, slots=True)
class Soundness:
    """What can be wrong with a covariance.

    Args:
        finite: no NaN, no infinity.   asymmetry: largest |C - C'|.
        smallest: smallest eigenvalue of C relative to the largest in magnitude.   size: number of states.
    """

    finite: bool
    asymmetry: float
    smallest: float
    size: int

    @property
    def condition(self) -> float:
        """Condition number of C; infinite where it is singular or indefinite."""
        return 1.0 / self.smallest if self.smallest > 0.0 else np.inf

    def sound(self, regular: bool) -> bool:
        """Whether it is symmetric and positive semi-definite to rounding; `regular`: and has full rank."""
        least = self.size * np.finfo(float).eps if regular else -ROUNDING
        return self.finite and self.asymmetry <= ROUNDING and self.smallest >= least


@dataclass(frozen=True, slots=True)
class Repair:
    """A covariance after repair.

    Args:
        P: (n, n), symmetric.   size: largest change |P - P(given)|_ij / (s_i s_j) in the repaired P's own units.
        sound: whether it is sound now; the seed's repair may not be enough.
    """

    P: Matrix
    size: float
    sound: bool


def deviations(P: Matrix) -> Vector:
    """(n,) s_i = sqrt|P_ii|, 1 where that is 0 or not finite."""
    s = np.sqrt(np.abs(np.diagonal(P)))
    return np.where((s > 0.0) & np.isfinite(s), s, 1.0)


def unit_free(P: Matrix) -> Matrix:
    """C = P_ij / (s_i s_j); divided one after the other, since the product may underflow."""
    s = deviations(P)
    return np.asarray(P / s[:, None] / s[None, :])


def examine(P: Matrix) -> Soundness:
    """Symmetry, definiteness and condition of P (n, n)."""
    n = P.shape[0]
    if not np.isfinite(P).all():
        return Soundness(False, np.inf, -np.inf, n)
    C = unit_free(P)
    values = np.linalg.eigvalsh(0.5 * (C + C.T))
    largest = float(np.max(np.abs(values)))
    return Soundness(True, float(np.max(np.abs(C - C.T))), float(values[0]) / largest if largest else 0.0, n)


def repair(P: Matrix, policy: str, *, before: Matrix, diagonal: Vector, regular: bool) -> Repair:
    """Repair an unsound P.

    Args:
        policy: one of POLICIES.   before: (n, n) the last sound covariance (restore).
        diagonal: (n,) |o_i|, drawn by the caller (seed).   regular: P must have an inverse.
    Returns:
        The repaired P; unchanged but symmetric, and not sound, where P is not finite and nothing sound came before.
    Law: tests/laws/test_guard.py::test_no_repair_lowers_any_variance.
    """
    if not np.isfinite(P).all():
        good = before if policy == "restore" else P
        return Repair(good, np.inf, examine(good).sound(regular))
    symmetric = 0.5 * (P + P.T)
    repaired = symmetric
    if not examine(symmetric).sound(regular):
        repaired = symmetric + _added(symmetric, policy, before, diagonal)
    if policy == "restore" and not examine(repaired).sound(regular):
        repaired = repaired + _raised(
            repaired
        )  # what came before was unsound itself: the start of a singular run
    s = deviations(repaired)
    size = float(np.max(np.abs(repaired - P) / s[:, None] / s[None, :]))
    return Repair(repaired, size, examine(repaired).sound(regular))


def _added(P: Matrix, policy: str, before: Matrix, diagonal: Vector) -> Matrix:
    """What the policy adds to a symmetric, finite, unsound P."""
    match policy:
        case "seed":
            return np.diag(diagonal)
        case "shift":
            s, values = deviations(P), np.linalg.eigvalsh(unit_free(P))
            largest = float(np.max(np.abs(values)))
            return np.diag((2.0 * FLOOR * largest + max(0.0, -float(values[0]))) * s * s)
        case "eigen_floor":
            return _raised(P)
        case "restore":
            return _positive_part(before - P)
        case _:
            raise ValueError(f"no repair policy {policy!r}")


def _raised(P: Matrix) -> Matrix:
    """Positive semi-definite: lifts every eigenvalue of C below the floor to it."""
    s = deviations(P)
    values, vectors = np.linalg.eigh(unit_free(P))
    lift = np.maximum(2.0 * FLOOR * float(np.max(np.abs(values))) - values, 0.0)
    return np.asarray((vectors * lift) @ vectors.T * s[:, None] * s[None, :])


def _positive_part(D: Matrix) -> Matrix:
    """The positive semi-definite part of a symmetric D; P + [B - P]+ = B + [P - B]+ covers both P and B."""
    s = deviations(D)
    values, vectors = np.linalg.eigh(D / s[:, None] / s[None, :])
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T * s[:, None] * s[None, :])
