"""Decentralized topologies: one local filter for each sensor, row 0 fused from them.

`federated`, `federated_reset`, `information_sum`, `covariance_intersection`. `assembly` copies this file as
`correct.py`.
"""

from __future__ import annotations

from typing import Any

from fusiond.filters.innovation import Innovation
from fusiond.fusion.information_sum import absorb

from .choices import TOPOLOGY
from .circle import wrap
from .looking import describe, gated, look
from .master import merge_rows, restart_locals
from .predict import predict
from .recursion import condition, guarded


def correct(track: Any, design: Any, work: Any, reading: Any, report: Any) -> None:
    """Predict every filter to the reading, condition its sensor's own, and fuse. Writes x and P of all rows."""
    predict(track, design, work, 0, reading.t_ns)
    row = design.local[reading.sensor]
    central, x_before = look(track, design, work, 0, reading, corrects=False), track.x[row].copy()
    seen = look(track, design, work, row, reading)
    describe(Innovation(central.nu, central.H, seen.R), track.P[0], work, report)
    if gated(design, reading, report):
        return
    x, P = condition(track, design, track.x[row], track.P[row], seen)
    track.x[row], track.P[row] = wrap(design, x), P
    if TOPOLOGY == "information_sum":
        x, P = absorb(track.x[0], track.P[0], x_before, seen)
        track.x[0], track.P[0] = wrap(design, x), guarded(track, design, P, track.P[0])
        return
    merge_rows(track, design)
    if TOPOLOGY == "federated_reset":
        restart_locals(track, design)
