"""The compiled entry of a retraced run: readings that were accepted, in the order of their time."""

from __future__ import annotations

from typing import Any

from fusiond.engine.step.apply import apply
from fusiond.engine.step.timing import restart
from fusiond.numerics.arrays import copy_matrix, copy_vector
from fusiond.numerics.kernel import entry, kernel
from fusiond.types import RESET

from .chain import NOTHING, begin_chain


@kernel
def hand_out(work: Any, kept: Any) -> None:
    """Copy the update in progress into its record, and begin the next."""
    kept.t_ns = work.pass_t_ns
    kept.apart = work.pass_apart
    kept.channels = work.pass_channels
    copy_vector(work.pass_x, kept.x)
    copy_matrix(work.pass_U, kept.U)
    copy_vector(work.pass_d, kept.d)
    copy_matrix(work.pass_F, kept.F)
    copy_matrix(work.pass_h, kept.h)
    copy_matrix(work.pass_k, kept.k)
    copy_vector(work.pass_nu, kept.nu)
    copy_vector(work.pass_S, kept.S)
    work.pass_apart = 0
    begin_chain(work)
    if work.pass_J[0, 0] > 0.0:  # what the update did to the error, where it does something
        copy_matrix(work.pass_J, work.pass_F)


@entry
def run(
    tracks: Any, design: Any, works: Any, desks: Any, marks: Any, spares: Any, readings: Any, passes: Any
) -> int:
    """Apply accepted readings, each no older than the one before, and keep every update of the centralized filter.

    Args:
        tracks, design, works: one record each, works of `retrace_work_dtype`.   desks, marks, spares (of the layout's
            report): one element each, scratch.
        readings: stamped with the time of their measurement, resets among them.
        passes: as many records of `pass_dtype`, or more.
    Returns:
        How many passes were written.
    """
    work, count = works[0], 0
    for k in range(readings.shape[0]):
        if readings[k].sensor == RESET:
            restart(tracks[0], desks[0], design[0], marks)
            continue
        if not tracks[0].started:
            work.pass_apart = 1
            begin_chain(work)
        work.pass_channels = NOTHING
        apply(tracks[0], design[0], work, readings[k], spares[0])
        if work.pass_channels != NOTHING:
            hand_out(work, passes[count])
            count += 1
    return count
