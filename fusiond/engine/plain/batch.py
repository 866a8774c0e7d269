"""Topologies that fuse all readings of one stamp together: `stacked`, `information`, `seed_averaged`.

`assembly` copies this file as `correct.py`. The first reading of a stamp opens a batch with the estimate before it;
each further one is fused anew with all of the batch, from that estimate. So every report already holds a whole
estimate, and the last of a stamp that of them all.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.engine.step.predict import predict
from fusiond.filters.information import update_together
from fusiond.filters.innovation import Innovation
from fusiond.fusion.centralized import stacked, update_averaged

from .choices import TOPOLOGY
from .circle import wrap
from .looking import describe, gated, look
from .recursion import condition, guarded


def open_batch(track: Any) -> None:
    """Begin a batch at row 0's time, from its estimate. Writes track.batch_*."""
    track.batch_size = 0
    track.batch_t_ns = track.filter_t_ns[0]
    track.batch_x[:], track.batch_P[:], track.batch_honest[:] = track.x[0], track.P[0], track.honest
    track.batch_has[:] = 0


def put(track: Any, sensor: int, seen: Innovation) -> None:
    """Add one sensor's innovation to the batch."""
    m = seen.nu.shape[0]
    track.batch_nu[sensor, :m] = seen.nu
    track.batch_H[sensor, :m] = seen.H
    track.batch_R[sensor, :m, :m] = seen.R
    track.batch_has[sensor] = 1
    track.batch_size += 1


def parts(track: Any, design: Any) -> list[Innovation]:
    """The innovations of the batch, by sensor number."""
    found = []
    for sensor in np.flatnonzero(track.batch_has):
        m = design.dof[sensor]
        H, R = track.batch_H[sensor, :m].copy(), track.batch_R[sensor, :m, :m].copy()
        found.append(Innovation(track.batch_nu[sensor, :m].copy(), H, R))
    return found


def fuse(track: Any, design: Any) -> None:
    """Write row 0 (and the honest covariance) from the batch's own start and all of its readings."""
    x, P, together = track.batch_x, track.batch_P, parts(track, design)
    if TOPOLOGY == "seed_averaged":
        outcome = update_averaged(x, P, track.batch_honest, together)
        track.honest[:] = outcome.honest
        x, after = outcome.x, guarded(track, design, outcome.P, P)
    elif TOPOLOGY == "information":
        x, after = update_together(x, P, together)
        after = guarded(track, design, after, P)
    else:
        x, after = condition(track, design, x, P, stacked(together))
    track.x[0], track.P[0] = wrap(design, x), after


def correct(track: Any, design: Any, work: Any, reading: Any, report: Any) -> None:
    """Predict to the reading, add it to the batch of its stamp, fuse the batch."""
    predict(track, design, work, 0, reading.t_ns)
    again = track.batch_has[reading.sensor]
    if track.batch_size == 0 or again or track.batch_t_ns != track.filter_t_ns[0]:
        open_batch(track)
    track.x[0], track.P[0] = track.batch_x, track.batch_P
    seen = look(track, design, work, 0, reading)
    describe(seen, track.P[0], work, report)
    if not gated(design, reading, report):
        put(track, reading.sensor, seen)
    if track.batch_size > 0:
        fuse(track, design)
