"""A reading seen from one filter's mean, and what the report says of it."""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.engine.step.update import innovate, load_noise
from fusiond.filters.innovation import Innovation, Matrix, Vector
from fusiond.types import Verdict

from .noise import declared, trusted

GATED = int(Verdict.GATED)


def look(track: Any, design: Any, work: Any, row: int, reading: Any, *, corrects: bool = True) -> Innovation:
    """The reading's innovation at the mean of filter `row`. Leaves its noise as U diag(d) U' in work.R_U, R_d.

    Args:
        corrects: whether it is about to correct this filter, whose innovation then tells of its noise.
    """
    m = design.dof[reading.sensor]
    innovate(track, design, work, row, reading)
    load_noise(reading, design, work)
    work.R_d[:m] *= 1.0 + track.reaction.noise_excess[reading.sensor]
    if corrects:
        trusted(track, design, work, row, reading, track.P[row])
    U = np.triu(work.R_U[:m, :m], 1) + np.eye(m)
    return Innovation(work.nu[:m].copy(), work.H[:m].copy(), (U * work.R_d[:m]) @ U.T)


def describe(seen: Innovation, P: Matrix, work: Any, report: Any) -> None:
    """Report nu, the diagonals of S and R, and the innovation whitened channel by channel. Reads work.R_U, R_d."""
    m = seen.nu.shape[0]
    report.dof = m
    report.nu[:m] = seen.nu
    report.R_used[:m] = np.diagonal(seen.R)
    for i in range(m):
        report.R_declared[i] = declared(work, i, report.R_used[i])
    report.S[:m] = np.diagonal(seen.H @ P @ seen.H.T + seen.R)
    report.e[:m] = whitened(seen, P, work.R_U[:m, :m], work.R_d[:m])
    report.nis = float(report.e[:m] @ report.e[:m])


def gated(design: Any, reading: Any, report: Any) -> bool:
    """Whether noise cannot explain the reading just described, so that it is not used. Writes report.limit, verdict."""
    gate = design.tests.gate[reading.sensor]
    if gate <= 0.0:
        return False
    report.limit = gate
    if report.nis <= gate:
        return False
    report.verdict = GATED
    return True


def whitened(seen: Innovation, P: Matrix, R_U: Matrix, R_d: Vector) -> Vector:
    """(m,) each channel's innovation given those before it, over its deviation; 0 where that is not positive.

    Args:
        R_U, R_d: factors of R, R_U unit upper triangular; channels are decorrelated by R_U^-1 first.
    """
    m = seen.nu.shape[0]
    apart = np.linalg.inv(np.triu(R_U, 1) + np.eye(m))
    nu, H = apart @ seen.nu, apart @ seen.H
    x, e = np.zeros(P.shape[0]), np.zeros(m)
    for i in range(m):
        cross = P @ H[i]
        S = float(H[i] @ cross) + float(R_d[i])
        left = float(nu[i] - H[i] @ x)
        if S > 0.0:
            e[i] = left / np.sqrt(S)
            x, P = x + cross * (left / S), P - np.outer(cross, cross) / S
    return e
