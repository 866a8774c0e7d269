"""Seed 004's plant, and the constant-velocity plant: where their filters settle. A first look; the rest comes later."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from fusiond.simulation.registry import simulate
from tools.pages.seed_row import Row, between, near, within
from tools.pages.trials import Floats, configured, estimate

M_EXPECTED = {1.0: (0.3798, 0.0817, -0.2570), 2.3: (0.534538, 0.010133, -0.477568)}
"""Steady gain by Q, R = 1: four digits as published for the MathWorks demo, six recomputed."""
S_EXPECTED = {1.0: 1.61238, 2.3: 2.148401}
Y_VARIANCE_EXPECTED = {1.0: 0.379797, 2.3: 0.534538}
TRACE_EXPECTED = 3.344542
"""tr P+ at Q = 2.3."""


@dataclass(frozen=True, slots=True)
class Settled:
    """A filter after many readings of y1.

    M: (n,) gain P- C' / S.   S: innovation variance.   P: (n, n) after a reading.
    steps: readings after which gain and variances stay within 1e-6 of these.
    """

    M: Floats
    S: float
    P: Floats
    steps: int


def settled(config: str, R: float, duration_s: float, Q: float | None = None) -> Settled:
    """Run one simulated log with the sensor y1 alone; the figures do not depend on its values."""
    options: dict[str, Any] = {"R": (R,)}
    changes: dict[str, Any] = {}
    if Q is not None:
        options["Q"] = Q
        changes = {"model": {"Q": [[Q]]}}
    trial = estimate(configured(config, changes).engine(), simulate(config, 0, duration_s, **options))
    rows = trial.of("y1")
    P, S = trial.P[rows], trial.reports["S"][rows, 0]
    M = P[:, :, 0] / R
    distance = np.maximum(np.abs(M - M[-1]).max(axis=1), np.abs(S - S[-1]))
    return Settled(M[-1], float(S[-1]), P[-1], int(np.flatnonzero(distance > 1e-6)[-1]) + 2)


@cache
def reference_plant(Q: float) -> Settled:
    """The reference plant with one sensor, R = 1."""
    return settled("reference_plant", 1.0, 100.0, Q)


@cache
def constant_velocity() -> Settled:
    """The constant-velocity plant, q = 1, R = 0.01."""
    return settled("constant_velocity", 0.01, 20.0)


def constant_velocity_closed_form() -> tuple[float, float, float]:
    """Gain (2) and innovation variance of the piecewise constant-acceleration model.

    With lambda = sqrt(q) dt^2 / sqrt(R) and r = (4 + lambda - sqrt(8 lambda + lambda^2)) / 4: alpha = 1 - r^2,
    beta = 2 (2 - alpha) - 4 sqrt(1 - alpha), M = [alpha, beta / dt], S = R / (1 - alpha). Held against the Riccati
    equation by tests/scenarios/test_seed_004.py.
    """
    dt_s, R = 0.1, 0.01
    ratio = dt_s**2 / R**0.5
    r = (4.0 + ratio - (8.0 * ratio + ratio**2) ** 0.5) / 4.0
    alpha = 1.0 - r**2
    return alpha, (2.0 * (2.0 - alpha) - 4.0 * (1.0 - alpha) ** 0.5) / dt_s, R / (1.0 - alpha)


def reference_rows(Q: float) -> list[Row]:
    """The reference plant at one Q."""
    plant, M, digits = f"reference_plant, Q = {Q:g}", M_EXPECTED[Q], 4 if Q == 1.0 else 6
    S, y = S_EXPECTED[Q], Y_VARIANCE_EXPECTED[Q]

    def gain(state: int) -> Row:
        expected, name = f"{M[state]:.{digits}f}", f"{plant}, gain M{state + 1}"
        return Row(
            name,
            expected,
            lambda: float(reference_plant(Q).M[state]),
            "{:.6f}",
            within(M[state], 0.6 * 10.0**-digits),
        )

    return [
        *(gain(state) for state in range(3)),
        Row(
            f"{plant}, innovation variance S", f"{S:g}", lambda: reference_plant(Q).S, "{:.6f}", near(S, 5e-6)
        ),
        Row(
            f"{plant}, error variance of y",
            f"{y:.6f}",
            lambda: float(reference_plant(Q).P[0, 0]),
            "{:.6f}",
            near(y, 2e-6),
        ),
        Row(
            f"{plant}, readings until settled to 1e-6",
            "<= 60",
            lambda: float(reference_plant(Q).steps),
            "{:.0f}",
            between(1, 60),
        ),
    ]


def trace() -> float:
    """tr P+ at Q = 2.3."""
    return float(np.trace(reference_plant(2.3).P))


def rows() -> list[Row]:
    """The figures of the page."""
    alpha, beta, S = constant_velocity_closed_form()
    form = "{:.6f}"
    return [
        *reference_rows(1.0),
        *reference_rows(2.3),
        Row("reference_plant, Q = 2.3, tr P+", f"{TRACE_EXPECTED}", trace, form, near(TRACE_EXPECTED, 1e-6)),
        Row(
            "constant_velocity, gain on position",
            f"{alpha:.6f} (closed form)",
            lambda: float(constant_velocity().M[0]),
            form,
            near(alpha, 1e-6),
        ),
        Row(
            "constant_velocity, gain on velocity",
            f"{beta:.6f} (closed form)",
            lambda: float(constant_velocity().M[1]),
            form,
            near(beta, 1e-6),
        ),
        Row(
            "constant_velocity, S",
            f"{S:.6f} (closed form)",
            lambda: constant_velocity().S,
            form,
            near(S, 1e-6),
        ),
    ]
