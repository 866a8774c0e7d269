"""How soon a bias is found, over the soonest that physics allows at the same rate of false alarms."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from fusiond.numerics.cusum import shift_delay, shift_threshold
from fusiond.types import Alarm
from tools.scoreboard.board import Effort, Result, Row
from tools.scoreboard.false_alarms import quiet
from tools.scoreboard.oracle import delays_of, profile, settled, threshold
from tools.scoreboard.plants import REFERENCE, STATIC, Floats, Plant, plant_of, sensed
from tools.scoreboard.watching import Alarms, assembled, listen

PROMISED = 1e4
ROWS = (0.5, 1.0, 2.0, 3.0)
CURVE = (0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0, 4.0)
BEFORE = 200
"""Healthy readings before an onset that is not at the beginning."""


def after(d: float) -> int:
    """Readings after the onset of a shift d, many times the delay to be expected."""
    return math.ceil(min(max(60.0, 120.0 / d**2), 1200.0))


def settled_innovations(plant: Plant, z: Floats) -> Floats:
    """(runs, k) whitened innovations of the plain settled filter of a plant with one sensor, without a gate."""
    K, S = settled(plant)
    x = np.zeros((len(z), len(plant.A)))
    e = np.zeros(z.shape[:2])
    for k in range(z.shape[1]):
        nu = z[:, k, 0] - x @ plant.H[0]
        e[:, k] = nu / np.sqrt(S)
        x = (x + nu[:, None] * K) @ plant.A.T
    return e


def told(alarms: Alarms, runs: int, onset: int) -> tuple[float, float]:
    """Mean delay of the runs in which there was an alarm, and the share of those without."""
    delays = alarms.first(runs, onset)
    found = np.isfinite(delays)
    return float(delays[found].mean()), float(1.0 - found.mean())


def white_part(effort: Effort) -> Result:
    """White residuals, onset with the statistics at zero, against the exact run lengths of the CUSUM."""
    result = Result()
    for number, name in enumerate(("sharp", "robust")):
        config = sensed(STATIC, {"y": 1.0}, PROMISED, profile=name)
        assembly, plant = assembled(config), plant_of(config)
        found = quiet(assembly, plant, effort.runs(8_000_000, 1), 3000 + number)
        bank, service = found.interval(Alarm.CELL).value, found.interval().value
        tests = assembly.detection.tests if assembly.detection else 1.0
        limit = 1.30 * (1.0 + math.log(tests) / math.log(service))
        rng, engine = np.random.default_rng(3100 + number), assembly.engine()
        curve: dict[str, list[float]] = {"d": [], "delay": [], "bound": []}
        for d in CURVE if name == "sharp" else ROWS:
            runs = effort.runs(4000 if d > 0.6 else 8000)
            alarms = listen(assembly, engine, plant.run(rng, runs, after(d))[0] + d)
            delay, missed = told(alarms.only(Alarm.CELL), runs, 0)
            bound = shift_delay(shift_threshold(bank, d), d)
            for column, value in zip(curve, (d, delay, bound), strict=True):
                curve[column].append(value)
            if d not in ROWS:
                continue
            what = (
                f"bias of {d} sigma, white residuals, {name}, one sensor's bank, interval {bank:,.0f} samples"
            )
            what += f", missed {missed:.1%}" if missed else ""
            ratio = delay / bound
            result.rows.append(Row(f"2.white.{name}.{d}", what, delay, "readings", "exact CUSUM", ratio, "<= 1.30",
                                   ratio <= 1.30))  # fmt: skip
            delay, _ = told(alarms, runs, 0)
            bound = shift_delay(shift_threshold(service, d), d)
            ratio = delay / bound
            what = f"the same, whole service, {tests:.1f} tests, interval {service:,.0f} samples"
            result.rows.append(Row(f"2.service.{name}.{d}", what, delay, "readings", "exact CUSUM", ratio,
                                   f"<= {limit:.2f}", ratio <= limit))  # fmt: skip
        result.curves[f"white.{name}"] = dict(curve)
    return result


def against_oracle(
    assembly: Any,
    plant: Plant,
    fault: Floats,
    interval: float,
    healthy: Floats,
    window: int,
    runs: int,
    seed: int,
) -> tuple[Floats, Floats]:
    """(runs,) delays of the engine's bank and of the oracle on the same readings, from a stationary onset.

    Args:
        fault: (k,) error of the sensor from the onset on.   healthy: innovations to set the oracle's threshold by.
    """
    rng = np.random.default_rng(seed)
    z = plant.run(rng, runs, BEFORE + len(fault))[0]
    z[:, BEFORE:, 0] += fault
    alarms = listen(assembly, assembly.engine(), z)
    w = profile(plant, fault[:window])
    h = threshold(healthy, w, interval)
    return alarms.only(Alarm.CELL).first(runs, BEFORE), delays_of(settled_innovations(plant, z), w, h, BEFORE)


def healthy_innovations(plant: Plant, steps: int, seed: int) -> Floats:
    """(runs, k) innovations of the settled filter without a fault."""
    runs, length = 64, 2 * BEFORE + max(512, steps // 64)
    z = plant.run(np.random.default_rng(seed), runs, length)[0]
    return settled_innovations(plant, z)[:, BEFORE:]


def watched(config: Mapping[str, Any], effort: Effort, seed: int) -> tuple[Any, Plant, float]:
    """Assembly, plant, and the measured steps between false alarms of its bank."""
    assembly, plant = assembled(config), plant_of(config)
    found = quiet(assembly, plant, effort.runs(8_000_000, 1), seed)
    return assembly, plant, found.interval(Alarm.CELL).value


def reference_part(effort: Effort) -> Result:
    """A bias on the reference plant, one sensor, against the oracle that knows its profile and size."""
    result = Result()
    assembly, plant, interval = watched(sensed(REFERENCE, {"y": 1.0}, PROMISED), effort, 3300)
    healthy = healthy_innovations(plant, effort.runs(1_200_000, 60_000), 3301)
    steady = float(profile(plant, np.ones(600))[-1])
    curve: dict[str, list[float]] = {"d": [], "delay": [], "bound": []}
    for number, d in enumerate(ROWS):
        fault = np.full(after(d), d / steady)
        window = min(len(fault), 320 if d < 0.8 else 120)
        ours, best = against_oracle(
            assembly,
            plant,
            fault,
            interval,
            healthy,
            window,
            effort.runs(3000 if d < 1.5 else 12000),
            3310 + number,
        )
        delay, bound = float(ours[np.isfinite(ours)].mean()), float(best[np.isfinite(best)].mean())
        missed = float(np.isinf(ours).mean())
        ratio, apart = delay / bound, delay - bound
        what = f"bias of {d / steady:.1f} sigma, steady shift {d}, reference plant with one sensor, "
        what += f"interval {interval:,.0f} samples"
        what += f", missed {missed:.1%}" if missed else ""
        result.rows.append(Row(f"3.reference.{d}", what, delay, "readings", "oracle CUSUM", ratio,
                               "<= 1.35, or 0.5 readings", ratio <= 1.35 or apart <= 0.5))  # fmt: skip
        for column, value in zip(curve, (d, delay, bound), strict=True):
            curve[column].append(value)
    result.curves["reference"] = dict(curve)
    return result
