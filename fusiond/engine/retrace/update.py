"""The step's update, its scalar channels kept."""

from __future__ import annotations

from typing import Any

from fusiond.engine.records import CENTRAL
from fusiond.engine.step.guard import fuse
from fusiond.engine.step.inject import settle
from fusiond.engine.step.predict import predict
from fusiond.engine.step.sizes import ERRORS
from fusiond.engine.step.update import *  # noqa: F403 whoever imports from here finds all of it
from fusiond.engine.step.update import correct as correct_only
from fusiond.engine.step.update import innovate, load_noise
from fusiond.numerics.arrays import copy_matrix, copy_vector
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Matrix, Vector, whiten
from fusiond.types import Verdict

from .chain import NOTHING

USED = int(Verdict.USED)


@kernel
def keep_channels(track: Any, design: Any, work: Any, reading: Any) -> None:
    """Do the update of the centralized filter on a copy of it; writes work.pass_*, but not F.

    What the guard withholds of a gain is to a smoother an estimate that was moved, and noise that was added, after
    the best update: k is the best one's. Leaves the covariance before it in work.prior_U, prior_d.
    """
    sensor, dof = reading.sensor, design.dof[reading.sensor]
    innovate(track, design, work, CENTRAL, reading)
    load_noise(reading, design, work)
    for i in range(dof):
        work.R_d[i] *= 1.0 + track.reaction.noise_excess[sensor]
    copy_vector(track.x[CENTRAL], work.pass_x)
    for U, d in ((work.prior_U, work.prior_d), (work.pass_U, work.pass_d)):
        copy_matrix(track.U[CENTRAL], U)
        copy_vector(track.d[CENTRAL], d)
    whiten(work.R_U, work.nu, work.H, dof)
    for j in range(ERRORS):
        work.dx[j] = 0.0
    for i in range(dof):
        nu = work.nu[i]
        for j in range(ERRORS):
            nu -= work.H[i, j] * work.dx[j]
        S = fuse(work.pass_U, work.pass_d, sensor, i, nu, design, work)
        work.pass_nu[i] = nu
        work.pass_S[i] = S
        for j in range(ERRORS):
            work.pass_h[i, j] = work.H[i, j]
            work.pass_k[i, j] = (work.b[j] + work.withheld[j]) / S if S > 0.0 else 0.0
    work.pass_channels = dof
    settle(work.pass_x, work.pass_U, sensor, design, work)
    copy_matrix(work.J, work.pass_J)


@kernel
def is_covariance(track: Any, U: Matrix, d: Vector) -> bool:
    """Whether the centralized covariance has these factors, bit for bit."""
    for i in range(ERRORS):
        if track.d[CENTRAL, i] != d[i]:
            return False
        for j in range(i + 1, ERRORS):
            if track.U[CENTRAL, i, j] != U[i, j]:
                return False
    return True


@kernel  # type: ignore[no-redef] # stands for the one of the step
def correct(track: Any, design: Any, work: Any, row: int, reading: Any, out: bool, report: Any) -> None:
    """The step's own update; of the centralized filter, what it did stays in work.pass_*.

    A reading that the gate refused was no update. An update that was not what these files know (another version of the
    step) stands apart from what came before.
    """
    if row == CENTRAL:
        predict(track, design, work, CENTRAL, reading.t_ns)
        keep_channels(track, design, work, reading)
    correct_only(track, design, work, row, reading, out, report)
    if row == CENTRAL:
        if is_covariance(track, work.prior_U, work.prior_d):
            if report.verdict != USED:
                work.pass_channels = NOTHING
        elif not is_covariance(track, work.pass_U, work.pass_d):
            work.pass_apart = 1
        copy_vector(track.x[CENTRAL], work.pass_x)
        copy_matrix(track.U[CENTRAL], work.pass_U)
        copy_vector(track.d[CENTRAL], work.pass_d)
        work.pass_t_ns = track.filter_t_ns[CENTRAL]
