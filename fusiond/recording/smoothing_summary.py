"""What a smoothed run comes to: its part of `replay --json`, and the `smoothed` channel of its recording."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.numerics.ud import Matrix, Vector
from fusiond.recording.accumulators import TruthSums
from fusiond.recording.mcap_writer import McapWriter
from fusiond.recording.reading_json import number_json
from fusiond.recording.smoothing import Smoother
from fusiond.recording.views import Thinning
from fusiond.types import seconds

CHANNEL = "smoothed"


def summarise(
    smoother: Smoother,
    layout: Layout,
    *,
    sums: TruthSums | None = None,
    writer: McapWriter | None = None,
    estimate_hz: float = 20.0,
) -> dict[str, Any]:
    """Go through the smoothed states once.

    Args:
        smoother: after `finish`.   sums: empty ones, over the truth; None without.
        writer: gets states at most `estimate_hz` times a second of data time.
    Returns:
        `updates`, `segments` (smoothed each by itself: a reset lies between), `std` and `filter_std` (root mean square
        over the updates, by error slot), with truth `rmse`, `nees_mean`, `nees_dof`, `compared` as of the filter.
    """
    thinning, written = Thinning(estimate_hz), 0
    variance = np.zeros(layout.shape.errors)
    for block in smoother.smoothed():
        variance += np.diagonal(block["P"], axis1=1, axis2=2).sum(axis=0)
        if sums is not None:
            sums.add(block, block["P"] if sums.needs_covariances else None)
        if writer is not None:
            for state in thinning.pick(block):
                t_ns = int(state["state_t_ns"])
                writer.message(CHANNEL, smoothed_message(layout, state, written), t_ns, t_ns)
                written += 1
    out: dict[str, Any] = {
        "updates": smoother.updates,
        "segments": smoother.segments,
        "std": _deviations(layout, variance, smoother.updates),
        "filter_std": _deviations(layout, _filtered(smoother.filtered(), len(variance)), smoother.updates),
    }
    if sums is not None:
        out |= {"rmse": sums.rmse(), "nees_mean": sums.nees_mean(), "nees_dof": len(sums.state_columns)}
        out["compared"] = sums.count
    return out


def smoothed_message(layout: Layout, state: Any, seq: int) -> dict[str, Any]:
    """One smoothed state: `{t, seq, state{}, std{}}`."""
    names, errors = [slot.name for slot in layout.states], [slot.name for slot in layout.errors]
    std = np.sqrt(np.diagonal(state["P"]))
    return {
        "t": seconds(int(state["state_t_ns"])),
        "seq": seq,
        "state": dict(zip(names, map(number_json, state["x"]), strict=False)),
        "std": dict(zip(errors, map(number_json, std), strict=False)),
    }


def _filtered(blocks: Iterable[NDArray[Any]], n: int) -> Vector:
    """(n,) sum of the filter's own variances."""
    total = np.zeros(n)
    for block in blocks:
        U: Matrix = np.triu(block["U"], 1) + np.eye(n)
        total += np.einsum("kij,kj->i", U * U, block["d"])
    return total


def _deviations(layout: Layout, variance_sum: Vector, count: int) -> dict[str, float]:
    """Root mean square standard deviation by error slot; empty where there was no update."""
    if not count:
        return {}
    names = [slot.name for slot in layout.errors]
    return dict(zip(names, np.sqrt(variance_sum / count).tolist(), strict=False))
