"""Faults whose traces end: on constant velocity a bias shows for a while only, so that it is found then or never."""

from __future__ import annotations

import numpy as np

from fusiond.types import Alarm
from tools.scoreboard.board import Effort, Result, Row
from tools.scoreboard.delays import BEFORE, healthy_innovations, settled_innovations, watched
from tools.scoreboard.oracle import delays_of, profile, threshold
from tools.scoreboard.plants import VELOCITY, Floats, sensed
from tools.scoreboard.watching import listen

WITHIN = 50
"""Readings after the onset in which a fault counts as found."""
SIZES = (2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0)
"""Of the bias, in deviations of the sensor's noise."""
NOISE = 0.1


def size_at(sizes: Floats, shares: Floats, wanted: float) -> float:
    """Size found with this probability: straight between the measured ones on the scale of log odds."""
    odds = np.log(np.clip(shares, 1e-3, 1.0 - 1e-3) / (1.0 - np.clip(shares, 1e-3, 1.0 - 1e-3)))
    return float(np.interp(np.log(wanted / (1.0 - wanted)), np.maximum.accumulate(odds), sizes))


def finite_part(effort: Effort) -> Result:
    """Probability of finding a bias of constant velocity's only sensor, against the oracle's."""
    result = Result()
    assembly, plant, interval = watched(sensed(VELOCITY, {"y": NOISE}, 1e3), effort, 4000)
    healthy = healthy_innovations(plant, effort.runs(1_600_000, 60_000), 4001)
    ours, best = np.zeros(len(SIZES)), np.zeros(len(SIZES))
    rng, engine = np.random.default_rng(4002), assembly.engine()
    for i, size in enumerate(SIZES):
        z = plant.run(rng, effort.runs(3000, 100), BEFORE + WITHIN)[0]
        z[:, BEFORE:] += size * NOISE
        alarms = listen(assembly, engine, z).only(Alarm.CELL)
        ours[i] = float(np.isfinite(alarms.first(len(z), BEFORE)).mean())
        w = profile(plant, np.full(WITHIN, size * NOISE))
        h = threshold(healthy, w, interval)
        best[i] = float(np.isfinite(delays_of(settled_innovations(plant, z), w, h, BEFORE)).mean())
    sizes = np.array(SIZES)
    for wanted in (0.5, 0.9):
        value, bound = size_at(sizes, ours, wanted), size_at(sizes, best, wanted)
        what = (
            f"bias found with probability {wanted} within {WITHIN} readings, constant velocity, one sensor, "
        )
        what += f"interval {interval:,.0f} samples"
        ratio = value / bound
        result.rows.append(Row(f"4.finite.{wanted}", what, value, "sigma", "oracle CUSUM", ratio, "<= 1.10",
                               ratio <= 1.10))  # fmt: skip
    result.curves["finite"] = {"size": list(SIZES), "found": ours.tolist(), "oracle": best.tolist()}
    return result
