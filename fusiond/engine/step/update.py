"""Condition one filter on one reading, channel by channel."""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.engine.records import HAS_R
from fusiond.numerics.discretise import wrap_angle
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import bierman_update, ud_factor, ud_projected, whiten

from .inject import inject
from .observe import observe
from .predict import predict
from .sizes import ERRORS


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
        report.R_declared[i] = variance
        report.S[i] = ud_projected(track.U[0], track.d[0], work.H[i]) + variance


@kernel
def condition(track: Any, design: Any, work: Any, row: int, dof: int) -> float:
    """Fuse the channels in work.nu, H, R_* into filter `row`; writes work.e (whitened innovation), returns its nis.

    All channels are linearised at the prior mean, so that the result is that of one stacked update.
    """
    for j in range(ERRORS):
        work.dx[j] = 0.0
    whiten(work.R_U, work.nu, work.H, dof)
    nis = 0.0
    for i in range(dof):
        nu = work.nu[i]
        for j in range(ERRORS):
            nu -= work.H[i, j] * work.dx[j]
        S = bierman_update(work.dx, track.U[row], track.d[row], work.H[i], work.R_d[i], nu, work.a, work.b)
        work.e[i] = nu / np.sqrt(S) if S > 0.0 else 0.0
        nis += work.e[i] * work.e[i]
    inject(track.x[row], work.dx, design)
    return nis


@kernel
def correct(track: Any, design: Any, work: Any, row: int, reading: Any, report: Any) -> None:
    """Predict filter `row` to the reading and fuse it; the centralized filter (row 0) also reports."""
    dof = design.dof[reading.sensor]
    predict(track, design, work, row, reading.t_ns)
    innovate(track, design, work, row, reading)
    load_noise(reading, design, work)
    if row == 0:
        describe_innovation(track, design, work, reading, report)
    nis = condition(track, design, work, row, dof)
    if row == 0:
        report.nis = nis
        for i in range(dof):
            report.e[i] = work.e[i]
