"""A sensor that says nothing, the same again and again, or what is no number: how soon that is told."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fusiond.assembly.assembly import Assembly
from fusiond.engine.engine import Engine
from fusiond.types import TICK, Health, Verdict
from tools.scoreboard.board import Effort, Result, Row
from tools.scoreboard.exclusion import OUT
from tools.scoreboard.plants import VELOCITY, Floats, plant_of, sensed
from tools.scoreboard.watching import assembled, readings_of, step_ns

ONSET, AFTER, NOISE = 100, 20, 0.1
FINE = 100
"""Ticks in a period, by which a silence is timed."""


def silence(assembly: Assembly, engine: Engine, z: Floats) -> float:
    """Periods since the sensor's last reading at the first tick that tells of its silence; the others go on."""
    engine.process(readings_of(assembly, z[None, :ONSET])[0])
    period_ns, number = step_ns(assembly), assembly.layout.numbers["y2"]
    given = readings_of(assembly, z[None])[0]
    for step in range(ONSET, ONSET + AFTER):
        for part in range(FINE):
            tick = np.zeros(1, assembly.layout.reading)
            tick["sensor"], tick["t_ns"] = TICK, step * period_ns + part * period_ns // FINE
            if engine.process(tick)["health"][0, number] == Health.SILENT:
                return float(tick["t_ns"][0] - ONSET * period_ns) / period_ns
        now = given[(given["t_ns"] == (step + 1) * period_ns) & (given["sensor"] != number)]
        engine.process(now)
    return float("inf")


def frozen(assembly: Assembly, engine: Engine, z: Floats) -> float:
    """Equal readings after the one that is repeated, until the sensor is out of use."""
    z = z.copy()
    z[ONSET:, 1] = z[ONSET - 1, 1]
    reports = engine.process(readings_of(assembly, z[None])[0])
    number = assembly.layout.numbers["y2"]
    stuck = np.isin(reports["health"][:, number], OUT) & (reports["sensor"] == number)
    return float(np.argmax(stuck) // z.shape[1] - ONSET + 1) if stuck.any() else float("inf")


def no_number(assembly: Assembly, engine: Engine, z: Floats) -> float:
    """Readings that are NaN until one is refused by name."""
    z = z.copy()
    z[ONSET:, 1] = np.nan
    reports = engine.process(readings_of(assembly, z[None])[0])
    refused = reports["verdict"] == Verdict.NON_FINITE
    return float(np.argmax(refused) // z.shape[1] - ONSET + 1) if refused.any() else float("inf")


def outages_part(effort: Effort) -> Result:
    """Worst delays over runs; three sensors on constant velocity."""
    config = sensed(VELOCITY, {f"y{k}": NOISE for k in (1, 2, 3)}, 36_000.0)
    assembly, plant = assembled(config), plant_of(config)
    cases: tuple[tuple[str, str, str, float, Callable[[Assembly, Engine, Floats], float]], ...] = (
        ("silent", "silence of a sensor told after its last reading", "periods", 2.5 + 1.0 / FINE, silence),
        ("frozen", "sensor out of use that repeats one number", "readings", 3.0, frozen),
        ("nan", "a reading that is no number refused by name", "readings", 1.0, no_number),
    )
    result, engine = Result(), assembly.engine()
    for number, (identity, name, unit, reach, told) in enumerate(cases):
        z = plant.run(np.random.default_rng(8000 + number), effort.runs(40, 4), ONSET + AFTER)[0]
        worst = 0.0
        for run in z:
            engine.reset()
            worst = max(worst, told(assembly, engine, run))
        result.rows.append(Row(f"8.{identity}", f"{name}, worst of {len(z)} runs", worst, unit, "", None,
                               f"<= {reach:.3g}", worst <= reach))  # fmt: skip
    return result
