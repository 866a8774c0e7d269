"""How soon a drift is found on the reference plant, over an oracle that knows its slope; and the law of the delay."""

from __future__ import annotations

import numpy as np

from tools.scoreboard.board import Effort, Result, Row
from tools.scoreboard.delays import PROMISED, against_oracle, healthy_innovations, watched
from tools.scoreboard.plants import REFERENCE, sensed

SLOPES = {1.0: 40, 0.3: 80, 0.1: 160, 0.03: 320, 0.01: 560, 0.003: 1000}
"""Slope in deviations of the noise a reading, and the readings after its onset: over two delays."""
SHARE = 30.0
"""Slopes count whose oracle's delay is at most the interval between false alarms over this."""
LAW = -2.0 / 3.0


def drift_part(effort: Effort) -> Result:
    """Delay against slope."""
    result = Result()
    assembly, plant, interval = watched(sensed(REFERENCE, {"y": 1.0}, PROMISED), effort, 5000)
    healthy = healthy_innovations(plant, effort.runs(600_000, 60_000), 5001)
    curve: dict[str, list[float]] = {"slope": [], "delay": [], "bound": []}
    for number, (slope, length) in enumerate(SLOPES.items()):
        fault = slope * np.arange(1.0, length + 1.0)
        ours, best = against_oracle(
            assembly, plant, fault, interval, healthy, length, effort.runs(800), 5010 + number
        )
        delay, bound = float(ours[np.isfinite(ours)].mean()), float(best[np.isfinite(best)].mean())
        for column, value in zip(curve, (slope, delay, bound), strict=True):
            curve[column].append(value)
        counts = bound <= interval / SHARE
        what = f"drift of {slope} sigma a reading, reference plant with one sensor, interval {interval:,.0f} samples"
        missed = float(np.isinf(ours).mean())
        what += f", missed {missed:.1%}" if missed else ""
        ratio = delay / bound
        result.rows.append(Row(f"5.drift.{slope}", what, delay, "readings", "oracle CUSUM", ratio,
                               "<= 1.30" if counts else "published", ratio <= 1.30 or not counts))  # fmt: skip
    within = np.array(curve["bound"]) <= interval / SHARE
    logs = np.log(np.array(curve["slope"])[within]), np.log(np.array(curve["delay"])[within])
    law = float(np.polyfit(*logs, 1)[0])
    result.rows.append(Row("5.law", "slope of log delay over log drift, the detector's own", law, "", "-2/3", law / LAW,
                           "-0.67 +- 0.03", abs(law - LAW) <= 0.03))  # fmt: skip
    result.curves["drift"] = dict(curve)
    return result
