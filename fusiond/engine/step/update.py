"""Condition one filter on one reading, channel by channel."""

from __future__ import annotations

from typing import Any

from fusiond.engine.records import CENTRAL, HAS_R
from fusiond.numerics.arrays import copy_matrix, copy_vector
from fusiond.numerics.discretise import wrap_angle
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import ud_factor, ud_projected, whiten
from fusiond.types import Verdict

from .adapt import declared_variance, fuse_channel, gate_width, prepare, root_of, scale_slowly, trust
from .guard import begin_learning, forget_learning, note_learning
from .inject import settle
from .monitor import after_look, after_update, before_update, note_gate, undelay
from .observe import observe
from .pending import keep_pending, put_back_pending
from .predict import predict
from .sizes import ERRORS

GATED, EXCLUDED = int(Verdict.GATED), int(Verdict.EXCLUDED)


@kernel
def load_noise(reading: Any, design: Any, work: Any) -> bool:
    """Write the reading's R as U diag(d) U' into work.R_U, R_d; False where the R it carries is not a covariance."""
    sensor = reading.sensor
    dof = design.dof[sensor]
    if not reading["flags"] & HAS_R:
        for i in range(dof):
            work.R_d[i] = design.R_d[sensor, i]
            for j in range(dof):
                work.R_U[i, j] = design.R_U[sensor, i, j]
        return True
    for i in range(dof):
        for j in range(dof):
            if not abs(reading.R[i, j] - reading.R[j, i]) <= 1e-9 * (
                abs(reading.R[i, i]) + abs(reading.R[j, j])
            ):
                return False
            work.R[i, j] = reading.R[i, j]
    return ud_factor(work.R[:dof, :dof], work.R_U, work.R_d, 1e-12)


@kernel
def innovate(track: Any, design: Any, work: Any, row: int, reading: Any) -> bool:
    """Write nu = z - h(x) and H of filter `row` into work.nu, H; False where z carries an unknown index."""
    sensor = reading.sensor
    dof = design.dof[sensor]
    work.h[:] = 0.0
    work.H[:] = 0.0
    x = track.x[row]
    if not observe(sensor, x, reading.z, design.at[sensor], design.sp[sensor], work.h, work.H):
        return False
    for i in range(dof):
        work.nu[i] = reading.z[i] - work.h[i]
        if design.wraps[sensor, i]:
            work.nu[i] = wrap_angle(work.nu[i])
    return True


@kernel
def describe_innovation(track: Any, design: Any, work: Any, reading: Any, report: Any) -> None:
    """Report nu and the diagonals of S and R before the update of the centralized filter. Reads work.nu, H, R_*."""
    dof = design.dof[reading.sensor]
    report.dof = dof
    for i in range(dof):
        variance = work.R_d[i]
        for j in range(i + 1, dof):
            variance += work.R_U[i, j] * work.R_U[i, j] * work.R_d[j]
        report.nu[i] = work.nu[i]
        report.R_used[i] = variance
        report.R_declared[i] = declared_variance(track, work, reading.sensor, i, variance)
        report.S[i] = ud_projected(track.U[0], track.d[0], work.H[i]) + variance


@kernel
def condition(track: Any, design: Any, work: Any, row: int, sensor: int) -> float:
    """Fuse the channels in work.nu, H, R_* into filter `row`; writes work.e (whitened innovation), returns its nis.

    All channels are linearised at the prior mean, so that the result is that of one stacked update.
    """
    dof = design.dof[sensor]
    for j in range(ERRORS):
        work.dx[j] = 0.0
    whiten(work.R_U, work.nu, work.H, dof)
    if row == CENTRAL:
        begin_learning(track, work)
    nis = 0.0
    for i in range(dof):
        nu = work.nu[i]
        for j in range(ERRORS):
            nu -= work.H[i, j] * work.dx[j]
        S = fuse_channel(track, design, work, row, sensor, i, nu)
        work.root[i] = root_of(work, i, S)
        work.e[i] = nu / work.root[i] if S > 0.0 else 0.0
        if row == CENTRAL:
            for j in range(ERRORS):
                work.K[i, j] = work.b[j] / S if S > 0.0 else 0.0
            note_learning(track, design, work, S)
        nis += work.e[i] * work.e[i]
    settle(track.x[row], track.U[row], sensor, design, work)
    return nis


@kernel
def keep(track: Any, work: Any, row: int) -> None:
    """Copy filter `row` aside."""
    copy_vector(track.x[row], work.kept_x)
    copy_vector(track.d[row], work.kept_d)
    copy_matrix(track.U[row], work.kept_U)
    keep_pending(track, work, row)


@kernel
def put_back(track: Any, work: Any, row: int) -> None:
    """Undo what happened to filter `row` since `keep`."""
    copy_vector(work.kept_x, track.x[row])
    copy_vector(work.kept_d, track.d[row])
    copy_matrix(work.kept_U, track.U[row])
    put_back_pending(track, work, row)
    if row == CENTRAL:
        forget_learning(track, work)


@kernel
def meet(track: Any, design: Any, work: Any, row: int, reading: Any, report: Any) -> None:
    """Predict filter `row` to the reading and take the innovation; the primary filter (row 0) also reports."""
    sensor = reading.sensor
    predict(track, design, work, row, reading.t_ns)
    prepare(track, design, work, row, reading.t_ns)
    innovate(track, design, work, row, reading)
    load_noise(reading, design, work)
    for i in range(design.dof[sensor]):
        work.R_d[i] *= 1.0 + track.reaction.noise_excess[sensor]
    trust(track, design, work, row, sensor)
    if row == CENTRAL:
        before_update(track, design, work, reading)
    undelay(track, design, work, reading)
    if row == CENTRAL:
        describe_innovation(track, design, work, reading, report)


@kernel
def correct(track: Any, design: Any, work: Any, row: int, reading: Any, out: bool, report: Any) -> None:
    """Predict filter `row` to the reading and fuse it, unless its own gate says that noise cannot explain it.

    Args:
        out: the sensor is excluded: compare its reading with the filter, and leave the filter as it was.
    """
    dof, gate = design.dof[reading.sensor], design.tests.gate[reading.sensor]
    meet(track, design, work, row, reading, report)
    gated = gate > 0.0
    if gated or out:
        keep(track, work, row)
    nis = condition(track, design, work, row, reading.sensor)
    gate *= gate_width(work)
    used = not out and (not gated or nis <= gate)
    if not used:
        put_back(track, work, row)
    if not out:
        note_gate(track, design, row, reading.sensor, nis)
    if row != CENTRAL:
        return
    report.nis = nis
    for i in range(dof):
        report.e[i] = work.e[i]
    if gated and not out:
        report.limit = gate
    if not used:
        report.verdict = EXCLUDED if out else GATED
    scale_slowly(track, work, reading.sensor, dof)
    if out:
        after_look(track, design, work, reading)
    else:
        after_update(track, design, work, reading, used)
