"""Row 0 from the local filters, and the local filters from row 0."""

from __future__ import annotations

from typing import Any

from fusiond.engine.step.sizes import FILTERS
from fusiond.fusion.covariance_intersection import intersect
from fusiond.fusion.federated import merge, split

from .choices import TOPOLOGY
from .circle import near, wrap


def merge_rows(track: Any, design: Any) -> None:
    """Fuse rows 1.. into row 0."""
    first = track.x[1]
    estimates = [(near(design, track.x[row], first), track.P[row]) for row in range(1, FILTERS)]
    x, P = intersect(estimates) if TOPOLOGY == "covariance_intersection" else merge(estimates)
    track.x[0], track.P[0] = wrap(design, x), P


def restart_locals(track: Any, design: Any) -> None:
    """Full reset: every local filter restarts at row 0's mean with its share of that information."""
    for row, P in enumerate(split(track.P[0], design.share[1:]), start=1):
        track.x[row], track.P[row] = track.x[0], P
