"""The picture of the mower, as SVG with the same bytes at every run. Needs matplotlib."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tools.pages.figures import figure
from tools.pages.recorded import Recorded, errors
from tools.pages.recording_pictures import ESTIMATE, LOST, OTHER, TRUTH
from tools.pages.recording_ranges_rows import SCALE, SCALE_REACH


def mower(scaled: Recorded, raw: Recorded, path: Path) -> None:
    """The way by both configurations, their errors, and the scale as it is found."""
    truth, beacons = scaled.truth, scaled.assembly.config.sensor["uwb"].beacons  # type: ignore[attr-defined]
    assert truth is not None
    places = np.array(beacons)
    with figure(path, 9.0, 6.4) as drawn:
        parts: Any = drawn.subplot_mosaic([["map", "error"], ["map", "scale"]], width_ratios=[1.35, 1.0])
        parts["map"].plot(*truth.values[::4, :2].T, color=TRUTH, lw=1.4, label="GPS")
        for run, colour, name in ((raw, LOST, "ranges as they come"), (scaled, ESTIMATE, "scale a state")):
            ranges = run.used("uwb")
            parts["map"].plot(*run.reports["x"][ranges, :2].T, color=colour, lw=0.8, label=name)
            t_s, apart = errors(run, run.reports, ["x", "y"])
            parts["error"].plot(t_s, np.hypot(*apart.T), color=colour, lw=0.8, label=name)
        parts["map"].plot(places[:, 1], places[:, 2], "^", color=OTHER, ms=8, label="beacons")
        parts["map"].set(
            xlabel="x, m", ylabel="y, m", title="plaza2: a mower among four beacons", aspect="equal"
        )
        parts["map"].legend(loc="lower left")
        parts["error"].set(ylabel="error of position, m", ylim=(0, None), xlim=(0, 410))
        parts["error"].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
        found, std = scaled.reports["x"][:, 3], scaled.reports["std"][:, 3]
        at = slice(None, None, 5)
        low, high = (found - 3.0 * std)[at], (found + 3.0 * std)[at]
        parts["scale"].axhspan(SCALE - SCALE_REACH, SCALE + SCALE_REACH, color=OTHER, alpha=0.25, lw=0)
        parts["scale"].fill_between(scaled.t_s[at], low, high, color=ESTIMATE, alpha=0.2, lw=0)
        parts["scale"].plot(scaled.t_s[at], found[at], color=ESTIMATE, lw=1.0)
        parts["scale"].set(
            xlabel="time, s", ylabel="scale of the ranges, 3 sigma", xlim=(0, 410), ylim=(1.03, 1.11)
        )
