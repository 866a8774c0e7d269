"""Bring every filter of a decentralized topology forward; other topologies use the compiled step's file."""

from __future__ import annotations

from typing import Any

from fusiond.engine.step.predict import predict as bring
from fusiond.engine.step.sizes import FILTERS

from .choices import TOPOLOGY
from .master import merge_rows


def predict(track: Any, design: Any, work: Any, row: int, t_ns: int) -> None:
    """Predict filter `row` to t_ns; row 0 brings all others with it and is fused from them.

    The centre of `information_sum` predicts for itself, and so does that of `federated_reset`, whose locals all
    hold a share of it.
    """
    if row > 0:
        bring(track, design, work, row, t_ns)
        return
    before_ns = track.filter_t_ns[0]
    for other in range(FILTERS):
        bring(track, design, work, other, t_ns)
    if track.filter_t_ns[0] != before_ns and TOPOLOGY in {"federated", "covariance_intersection"}:
        merge_rows(track, design)


follow = predict
"""By an input; a plain covariance is never late."""
