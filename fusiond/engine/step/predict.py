"""Bring a filter forward in time: whole steps of a discrete model, or intervals short enough for its transition."""

from __future__ import annotations

from typing import Any

from fusiond.numerics.kernel import kernel

from .advance import advance
from .pending import settle_pending, settle_when_due


@kernel
def move(track: Any, design: Any, work: Any, row: int, t_ns: int) -> None:
    """Predict filter `row` to t_ns >= its time; a discrete model goes to the nearest multiple of its step.

    Reads track.u, u_var; writes the row's x, U, d, filter_t_ns.
    """
    dt_ns = t_ns - track.filter_t_ns[row]
    if dt_ns <= 0:
        return
    if design.step_ns > 0:
        steps = (dt_ns + design.step_ns // 2) // design.step_ns
        for _ in range(steps):
            advance(track, design, work, row, design.step_ns)
        track.filter_t_ns[row] += steps * design.step_ns
        return
    pieces = 1
    if design.max_step_ns > 0:
        pieces = (dt_ns + design.max_step_ns - 1) // design.max_step_ns
    for piece in range(pieces):
        advance(track, design, work, row, dt_ns * (piece + 1) // pieces - dt_ns * piece // pieces)
    track.filter_t_ns[row] = t_ns


@kernel
def predict(track: Any, design: Any, work: Any, row: int, t_ns: int) -> None:
    """Predict filter `row`, its covariance included."""
    move(track, design, work, row, t_ns)
    settle_pending(track, work, row)


@kernel
def follow(track: Any, design: Any, work: Any, row: int, t_ns: int) -> None:
    """Predict filter `row` by an input; its covariance may follow later."""
    before_ns = track.filter_t_ns[row]
    move(track, design, work, row, t_ns)
    settle_when_due(track, design, work, row, before_ns)
