"""What is left after an exclusion: the run that never had the sensor, bit for bit; and a second fault kept out."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.engine import Engine
from fusiond.simulation.registry import simulate
from fusiond.types import NANOSECONDS, Health
from tools.pages.trials import configured, merged, records
from tools.scoreboard.board import Effort, Result, Row
from tools.scoreboard.judging import places
from tools.scoreboard.plants import VELOCITY, Floats, plant_of, sensed
from tools.scoreboard.watching import Records, assembled, readings_of

NOISE, ONSET, AFTER, SOON = 0.1, 100, 60, 5
OUT = (int(Health.EXCLUDED), int(Health.PROBATION))
"""Health of a sensor that is not used."""
GARBAGE_FROM = 150
"""Step from which the first sensor of the second-fault runs sends nothing that is a number."""
BEFORE_IT = 3
"""Steps before its exclusion at which the second fault begins: ten readings of three sensors."""
SIGMAS, SECOND = 8.0, 6.0
LOST, LOST_NS = "heading", 20 * NANOSECONDS
"""The sensor that errs on the drive in the plane, and since when."""


def same_bytes(faulted: Records, spared: Records, health: Floats) -> bool:
    """Whether states and deviations are equal to the bit from SOON steps after the exclusion on."""
    out = np.isin(health, OUT)
    if not out.any():
        return False
    since = int(np.argmax(out)) + SOON
    until = since + int(np.argmin(out[since:])) if not out[since:].all() else len(out)
    return until > since and all(
        faulted[field][since:until].tobytes() == spared[field][since:until].tobytes()
        for field in ("x", "std")
    )


def equal_rows(effort: Effort, result: Result) -> None:
    """A biased sensor, against a service that was configured without it."""
    three = sensed(VELOCITY, {f"y{k}": NOISE for k in (1, 2, 3)}, 36_000.0)
    two = sensed(VELOCITY, {"y1": NOISE, "y3": NOISE}, 36_000.0)
    with_it, without = assembled(three), assembled(two)
    z = plant_of(three).run(np.random.default_rng(7000), effort.runs(60), ONSET + AFTER)[0]
    z[:, ONSET:, 1] += SIGMAS * NOISE
    engine, spared = with_it.engine(), without.engine()
    equal = returned = 0
    for faulted, healthy in zip(readings_of(with_it, z), readings_of(without, z[:, :, ::2]), strict=True):
        engine.reset()
        spared.reset()
        steps, numbers = places(with_it, engine.process(faulted))
        others, _ = places(without, spared.process(healthy))
        health = steps["health"][:, numbers[1]]
        equal += same_bytes(steps, others, health)
        returned += int(Health.PROBATION in health[ONSET:])
    share = equal / len(z)
    told = f"state and deviations of a run equal, to the bit, to one that never had the sensor, from {SOON} readings "
    told += "after its exclusion on; constant velocity, three sensors, bias of 8 sigma"
    result.rows.append(
        Row("7.bytes", told, share, "of runs", "a run without the sensor", None, "1", equal == len(z))
    )
    told = f"the same runs: on probation within {AFTER} readings, though the bias goes on"
    back = returned / len(z)
    result.rows.append(Row("7.probation", told, back, "of runs", "", None, "<= 0.01", back <= 0.01))


@dataclass(slots=True)
class Errors:
    """Sums of squared errors of position while a sensor is out: of the run that lost it, and of the one without it."""

    lost: float = 0.0
    never: float = 0.0
    excluded: int = 0

    def add(self, faulted: Records, spared: Records, out: NDArray[np.bool_], truth: Floats) -> None:
        """Take in a run: reports on the same readings, (k,) whether the sensor is out, (k, n) true positions."""
        if not out.any():
            return
        self.excluded += 1
        since = np.flatnonzero(out)[0] + SOON
        kept, n = np.flatnonzero(out[since:]) + since, truth.shape[1]
        self.lost += float(np.sum((faulted["x"][kept, :n] - truth[kept]) ** 2))
        self.never += float(np.sum((spared["x"][kept, :n] - truth[kept]) ** 2))

    def row(self, identity: str, what: str, runs: int) -> Row:
        """Their ratio, as RMSE."""
        ratio = math.sqrt(self.lost / self.never) if self.never else math.nan
        told = f"RMSE of position after the exclusion, {what}; excluded in {self.excluded} of {runs} runs"
        return Row(
            f"7.rmse.{identity}", told, ratio, "", "a run without the sensor", ratio, "<= 1.05", ratio <= 1.05
        )


def adapted_row(effort: Effort) -> Row:
    """Noise estimated: what the sensor said before it erred has been weighed by what was thought of its noise then."""
    more: dict[str, Any] = {"adaptation": {}}
    three = merged(sensed(VELOCITY, {f"y{k}": NOISE for k in (1, 2, 3)}, 36_000.0), more)
    with_it = assembled(three)
    without = assembled(merged(sensed(VELOCITY, {"y1": NOISE, "y3": NOISE}, 36_000.0), more))
    z, states = plant_of(three).run(np.random.default_rng(7200), effort.runs(60, 4), ONSET + 4 * AFTER)
    z[:, ONSET:, 1] += SIGMAS * NOISE
    engine, spared, errors = with_it.engine(), without.engine(), Errors()
    given = zip(readings_of(with_it, z), readings_of(without, z[:, :, ::2]), states, strict=True)
    for faulted, healthy, truth in given:
        engine.reset()
        spared.reset()
        steps, numbers = places(with_it, engine.process(faulted))
        others, _ = places(without, spared.process(healthy))
        errors.add(steps, others, np.isin(steps["health"][:, numbers[1]], OUT), truth[:, :1])
    return errors.row(
        "adapted", f"constant velocity, noise estimated, {SIGMAS:.0f} sigma on one of three", len(z)
    )


def extended_row(effort: Effort) -> Row:
    """An extended filter: the one that takes over has linearised about an estimate without the error all along."""
    faults = {"faults": {"mean_time_between_false_alarms_s": 36_000.0}}
    with_it = configured("planar", faults)
    without = configured("planar", faults | {"sensor": {LOST: None}})
    engine, spared, errors, runs = with_it.engine(), without.engine(), Errors(), effort.runs(10, 2)
    for seed in range(runs):
        drive = simulate("planar", seed=seed, duration_s=60.0)
        given = records(with_it.layout, drive.readings)
        theirs = given["sensor"] == with_it.layout.numbers[LOST]
        given["z"][theirs & (given["t_ns"] >= LOST_NS), 0] += SIGMAS * 0.02
        engine.reset()
        spared.reset()
        reports = engine.process(given)[~theirs]
        others = spared.process(records(without.layout, drive.readings))
        columns = [drive.truth.names.index(name) for name in ("x", "y")]
        truth = np.stack(
            [np.interp(reports["t_ns"], drive.truth.t_ns, drive.truth.values[:, c]) for c in columns], axis=1
        )
        out = np.isin(reports["health"][:, with_it.layout.numbers[LOST]], OUT)
        errors.add(reports, others, out, truth)
    return errors.row(
        "extended", f"configs/planar.toml (extended filter), {SIGMAS:.0f} sigma on `{LOST}`", runs
    )


def nees(engine: Engine, truth: Floats) -> float:
    """e' P^-1 e of the filter that hears neither the first sensor nor the second."""
    layout, track = engine.layout, engine.track[0]
    second = layout.numbers["y2"]
    rows = [k for k, one in enumerate(layout.filters) if one.hears == "without" and one.sensor == "y2"]
    return nees_of(engine, 0 if track["reaction"]["health"][second] in OUT else rows[0], truth)


def nees_of(engine: Engine, row: int, truth: Floats) -> float:
    """e' P^-1 e of one filter."""
    error = engine.track[0]["x"][row] - truth
    return float(error @ np.linalg.solve(engine.covariance(row), error))


def second_rows(effort: Effort, result: Result) -> None:
    """While one sensor is being excluded another one is already wrong.

    The filter that is left must be the one that heard the third sensor alone. That one runs beside it on the same
    readings; its expected NEES is 2 exactly, so what is measured is the difference, which needs few runs.
    """
    config = sensed(VELOCITY, {f"y{k}": NOISE for k in (1, 2, 3)}, 36_000.0)
    assembly, plant = assembled(config), plant_of(config)
    alone = assembled(sensed(VELOCITY, {"y3": NOISE}, 36_000.0))
    z, states = plant.run(np.random.default_rng(7100), effort.runs(150, 20), GARBAGE_FROM + 4)
    z[:, GARBAGE_FROM:, 0] = np.nan
    excluded_at = GARBAGE_FROM + 1
    z[:, excluded_at - BEFORE_IT :, 1] += SECOND * NOISE
    engine, third = assembly.engine(), alone.engine()
    steps = excluded_at + 1
    values, apart = [], []
    for run, readings in enumerate(readings_of(assembly, z)):
        engine.reset()
        engine.process(readings[: 3 * steps])
        if engine.track[0]["reaction"]["health"][engine.layout.numbers["y1"]] not in OUT:
            continue  # the second fault was the first to be found
        third.reset()
        third.process(readings_of(alone, z[run : run + 1, :steps, 2:])[0])
        values.append(nees(engine, states[run, excluded_at]))
        apart.append(values[-1] - nees_of(third, 0, states[run, excluded_at]))
    mean = 2.0 + float(np.mean(apart)) if apart else float("nan")
    spread = float(np.std(apart) / np.sqrt(max(len(apart), 1)))
    told = "NEES, two states, without both, in the step of the first exclusion: 2 + its difference from that of the "
    told += (
        f"filter that heard the third sensor alone ({len(apart)} of {len(z)} runs, +- {1.96 * spread:.1g}; "
    )
    told += f"taken by itself {np.mean(values):.2f} +- {3.92 / np.sqrt(len(values)):.2f}); the second fault, "
    told += f"{SECOND:.0f} sigma, began ten readings before"
    result.rows.append(Row("7.second", told, mean, "", "2", mean / 2.0, "2.0 +- 0.1", abs(mean - 2.0) <= 0.1))


def exclusion_part(effort: Effort) -> Result:
    """After an exclusion."""
    result = Result()
    equal_rows(effort, result)
    second_rows(effort, result)
    result.rows += [adapted_row(effort), extended_row(effort)]
    return result
