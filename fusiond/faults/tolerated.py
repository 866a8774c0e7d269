"""Errors that are no fault: innovations, and what every fault does to them, seen past what is tolerated.

A tolerated error of a channel is unknown and moves slowly: normal, a third of the tolerance as its deviation, and
correlated over half the window (Gauss-Markov). It gives the whitened innovations the covariance

    C = I + sum X_c K_c X_c',    K_c = (tolerance_c / 3)^2 exp(-|t - t'| / tau),

X_c the responses to the channel's errors. With C = L L', L^-1 e is white again where no more is wrong than is
tolerated, and L^-1 w is what is left to see of a fault's signature w: a fault within the tolerance has no likelihood,
one beyond it the likelihood it exceeds it by, and no sensor is blamed for what another one is allowed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.linalg import solve_triangular

from fusiond.faults.course import Suspect
from fusiond.faults.response import Integers, Response
from fusiond.numerics.ud import Matrix

DEVIATIONS = 3.0
"""A tolerance is this many standard deviations of the errors it allows."""
MEMORY = 0.5
"""Share of the window over which a tolerated error stays about what it is."""


def tolerate(response: Response, tolerance: Mapping[Suspect, float]) -> Response:
    """The response past tolerated errors; itself where none is tolerated.

    Args:
        tolerance: of each channel and input, in its unit.
    """
    scatter = _scatter(response, tolerance)
    if scatter is None:
        return response
    E = len(response.e)
    filtered: Matrix = solve_triangular(
        np.linalg.cholesky(np.eye(E) + scatter), np.eye(E), lower=True, check_finite=False
    )
    e, impulses = filtered @ response.e, filtered @ response.impulses
    return replace(
        response,
        e=e,
        impulses=impulses,
        matched=impulses.T @ e,
        filtered=filtered,
    )


def _scatter(response: Response, tolerance: Mapping[Suspect, float]) -> Matrix | None:
    """(E, E) covariance that tolerated errors give the innovations; None where there are none."""
    memory_s = max(MEMORY * float(response.t_s[-1]), 1e-9)
    scatter: Matrix | None = None
    for suspect, limit in tolerance.items():
        columns, t_s = _columns(response, suspect)
        if limit <= 0.0 or not len(columns):
            continue
        K = (limit / DEVIATIONS) ** 2 * np.exp(-np.abs(t_s[:, np.newaxis] - t_s) / memory_s)
        X = response.impulses[:, columns]
        scatter = X @ K @ X.T + (0.0 if scatter is None else scatter)
    return scatter


def _columns(response: Response, suspect: Suspect) -> tuple[Integers, Matrix]:
    """Columns through which a suspect errs, and their times, s."""
    if suspect.is_input:
        columns, t_s = response.held[:, suspect.channel], response.t_s
    else:
        own = (response.sensor == suspect.sensor) & (response.raw[:, suspect.channel] >= 0)
        columns, t_s = response.raw[own, suspect.channel], response.t_s[own]
    found, into = np.unique(columns, return_inverse=True)
    return found, np.bincount(into, t_s) / np.bincount(into)
