"""Topology `centralized`: one filter, readings one after the other. Other topologies replace this file."""

from __future__ import annotations

from typing import Any

from fusiond.engine.step.predict import predict

from .circle import wrap
from .looking import describe, gated, look
from .recursion import condition


def correct(track: Any, design: Any, work: Any, reading: Any, report: Any) -> None:
    """Predict the filter to the reading and fuse it. Writes row 0 of x and P."""
    predict(track, design, work, 0, reading.t_ns)
    seen = look(track, design, work, 0, reading)
    describe(seen, track.P[0], work, report)
    if gated(design, reading, report):
        return
    x, P = condition(track, design, track.x[0], track.P[0], seen)
    track.x[0], track.P[0] = wrap(design, x), P
