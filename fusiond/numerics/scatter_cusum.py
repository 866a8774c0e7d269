"""Exact run lengths of the CUSUM for a change of the variance of white unit noise from 1 to s.

A reading of m channels adds g = (1 - 1/s) q / 2 - m ln(s) / 2 with q its sum of squares, chi-square with m degrees of
freedom. Its density is singular at its end, so the integral equation of the run length is solved with a piecewise
linear A on N equal intervals, whose moments under g are taken exactly (product integration, second order in 1/N).

Test: tests/calibration/test_cusum.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from scipy.linalg import toeplitz
from scipy.special import gammainc

from fusiond.numerics.cusum import SINGLE
from fusiond.numerics.ud import Matrix, Vector

CLOSE = 1e-3
"""Tolerance of the logarithm of the run length."""
CELLS = 120
"""Intervals of (0, h), a multiple of ten so that the limit of one reading falls between two."""

Law = Callable[[Vector], tuple[Vector, Vector]]
"""Distribution function F(x) of an increment, and its integral from minus infinity to x."""


def chi_square(q: Vector, dof: int) -> tuple[Vector, Vector]:
    """Distribution function of chi-square, and its integral from 0 to q."""
    at = np.maximum(q, 0.0) / 2.0
    F = np.asarray(gammainc(dof / 2.0, at), dtype=np.float64)
    return F, 2.0 * at * F - dof * np.asarray(gammainc(dof / 2.0 + 1.0, at), dtype=np.float64)


def increment_law(ratio: float, dofs: Mapping[int, float]) -> Law:
    """Law of the increment for a variance ratio s.

    Args:
        dofs: share of readings by their number of channels.
    """
    slope = 0.5 * (1.0 - 1.0 / ratio)
    shares = {dof: share / sum(dofs.values()) for dof, share in dofs.items()}

    def law(x: Vector) -> tuple[Vector, Vector]:
        F, integral = np.zeros_like(x), np.zeros_like(x)
        for dof, share in shares.items():
            offset = -0.5 * dof * math.log(ratio)
            F_q, integral_q = chi_square(np.asarray((x - offset) / slope, dtype=np.float64), dof)
            if slope > 0.0:
                F += share * F_q
                integral += share * slope * integral_q
            else:
                # g falls with q: mean of (x - g)+ is that of x - g, plus that of (g - x)+
                F += share * np.where(x >= offset, 1.0, 1.0 - F_q)
                integral += share * (x - offset - slope * dof - slope * integral_q)
        return F, integral

    return law


def run_length(threshold: float, law: Law, single: float = SINGLE) -> float:
    """Mean number of readings until the alarm, from 0; no reading adds more than `single` of the threshold."""
    step = threshold / CELLS
    lattice: Vector = np.asarray(step * np.arange(-CELLS, CELLS + 1), dtype=np.float64)
    F, integral = law(lattice)
    cap = single * threshold
    if single < 1.0:
        at_cap = law(np.array([cap]))[1][0]
        beyond = lattice >= cap - 1e-9 * threshold
        F, integral = np.where(beyond, 1.0, F), np.where(beyond, at_cap + lattice - cap, integral)
    kernel = _hats(F, integral, step)
    return float(np.linalg.solve(np.eye(CELLS + 1) - kernel, np.ones(CELLS + 1))[0])


def _hats(F: Vector, integral: Vector, step: float) -> Matrix:
    """(N + 1, N + 1): mean of each hat function of the grid after one step from each grid point below the threshold.

    F and its integral are given on the lattice -h, ..., h. The integral of hat_j against the step's law is the second
    difference of the integral of F.
    """
    N = CELLS
    inner = np.zeros_like(F)
    inner[1:-1] = (integral[2:] - 2.0 * integral[1:-1] + integral[:-2]) / step
    kernel: Matrix = toeplitz(inner[N::-1], inner[N:])
    start = N - np.arange(N + 1)
    kernel[:, 0] = (integral[start + 1] - integral[start]) / step
    last = start + N
    kernel[1:, N] = F[last[1:]] - (integral[last[1:]] - integral[last[1:] - 1]) / step
    kernel[0, N] = F[2 * N] - (integral[2 * N] - integral[2 * N - 1]) / step
    return kernel


def threshold(wanted: float, law: Law) -> float:
    """Threshold whose average run length is `wanted` readings."""
    target = math.log(wanted)
    low, high = 0.0, target + 3.0
    h = max(target - 2.0, 0.5)
    for _ in range(30):
        error = math.log(run_length(h, law)) - target
        if abs(error) < CLOSE:
            break
        low, high = (low, h) if error > 0.0 else (h, high)
        newton = h - error
        h = newton if low < newton < high else 0.5 * (low + high)
    return h
