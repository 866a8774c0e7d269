"""Adaptation: how near the estimate comes to the filter that is told R, and what is lost of finding faults."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from fusiond.assembly.assembly import Assembly
from fusiond.types import Alarm, Kind
from tools.pages.trials import merged
from tools.scoreboard.bands import share
from tools.scoreboard.board import Effort, Result, Row
from tools.scoreboard.delays import BEFORE, settled_innovations
from tools.scoreboard.false_alarms import quiet
from tools.scoreboard.oracle import delays_of, profile, threshold
from tools.scoreboard.plants import REFERENCE, Floats, Plant, plant_of, sensed
from tools.scoreboard.steps_of_noise import SPANS, STAY, TRUTHS, configuration, estimate_spread, stepped
from tools.scoreboard.watching import Records, assembled, listen, readings_of

REACH = {
    "interacting": {"low": 1.005, "high": 1.005, "up": 1.03, "down": 1.15},
    "fuzzy": {"low": 1.01, "high": 1.01, "up": 1.06, "down": 1.25},
}
"""RMSE over the oracle's that is to be reached."""
METHODS: tuple[tuple[str, dict[str, Any], int], ...] = (
    ("interacting", {}, 4000),
    ("interacting, one filter", {"separate_filters": False}, 500),
    ("variational", {"method": "variational"}, 500),
    ("fuzzy", {"method": "fuzzy"}, 1000),
    ("fuzzy_additive", {"method": "fuzzy_additive"}, 500),
)
"""Name, section, and runs of each."""
FACTOR = 25.0
PROMISED = 1e4
SIZES: tuple[tuple[str, float], ...] = (
    ("bias", 1.7), ("bias", 3.4), ("bias", 6.0), ("drift", 0.3), ("drift", 0.1), ("drift", 0.03),
)  # fmt: skip
NAMED: tuple[tuple[Kind, float, int, float], ...] = (
    (Kind.NOISE, 10.0, 10, 0.95), (Kind.BIAS, 10.0, 5, 0.85), (Kind.BIAS, 6.0, 10, 0.85), (Kind.BIAS, 3.4, 20, 0.85),
)  # fmt: skip
"""Kind, size in deviations, readings within which it is to be named, and how often."""
AFTER = 60
"""Readings with the error."""


def _row(
    identity: str, what: str, value: float, reach: str, ok: bool, against: str = "", unit: str = ""
) -> Row:
    """A row whose value is a ratio, or a plain number without a peer."""
    return Row(f"5.adapt.{identity}", what, value, unit, against, value if against else None, reach, bool(ok))


def steps_rows(effort: Effort, result: Result) -> None:
    """RMSE and NEES of every method on the step by FACTOR, and of the default on smaller and larger ones."""
    for number, (name, section, full) in enumerate(METHODS):
        found = stepped(assembled(configuration(**section)), FACTOR, effort.runs(full, 20), 9000 + number)
        reach, short = REACH.get(name, {}), name.replace(", ", ".").replace(" ", "_")
        for span in SPANS:
            value, error = found.ratio(span)
            limit = reach.get(span, math.inf)
            what = f"RMSE of position, {name}, noise x{FACTOR:.0f} and back, {span}; +-{2 * error:.4f}"
            told = f"<= {limit}" if reach else "published"
            result.rows.append(_row(f"rmse.{short}.{span}", what, value, told, value <= limit, "oracle R"))
        for span in ("low", "high"):
            value, error = found.mean_nees(span)
            ok, told = True, "published"
            if name == "interacting":
                ok, told = abs(value - 2.0) <= 0.05, "2.00 +- 0.05"
            elif name == "fuzzy":
                ok, told = value <= 2.15, "<= 2.15"
            what = f"NEES (ideal 2), {name}, {span}; +-{2 * error:.3f}; mean NIS {found.nis[span].mean():.3f}"
            result.rows.append(_row(f"nees.{short}.{span}", what, value, told, ok))
    default = assembled(configuration())
    for factor in (4.0, 100.0):
        found = stepped(default, factor, effort.runs(500, 20), 9050 + int(factor))
        for span in SPANS:
            value, error = found.ratio(span)
            what = f"RMSE of position, interacting, noise x{factor:.0f} and back, {span}; +-{2 * error:.4f}"
            result.rows.append(_row(f"rmse.x{factor:.0f}.{span}", what, value, "published", True, "oracle R"))


def spread_row(effort: Effort, result: Result) -> None:
    """How well a constant R is known after 500 readings."""
    ratios = [spread / bound for spread, bound in estimate_spread(effort.runs(500, 20), 9100)]
    each = ", ".join(f"{ratio:.2f} at {truth}" for truth, ratio in zip(TRUTHS, ratios, strict=True))
    what = f"rms error of a constant R, interacting, growing window, {STAY} readings; over declared R: {each}"
    result.rows.append(_row("whittle", what, max(ratios), "<= 1.2", max(ratios) <= 1.2, "Whittle bound"))


def watched_pair(effort: Effort) -> tuple[Any, Any, Any]:
    """The reference plant's engine with adaptation, without, and the plant; thresholds for one false-alarm interval."""
    config = sensed(REFERENCE, {"y": 1.0}, PROMISED)
    off, on = assembled(config), assembled(merged(config, {"adaptation": {}}))
    plant, steps = plant_of(config), effort.runs(2_000_000, 1)
    rare, often = (quiet(one, plant, steps, 9200).interval(Alarm.CELL).value for one in (off, on))
    if math.isfinite(rare) and math.isfinite(often):
        on.design["tests"]["limit"] += math.log(rare / often)
    return on, off, plant


def delay_rows(effort: Effort, result: Result) -> None:
    """Delay of a bias and of a drift with adaptation, over that without, on the same readings."""
    on, off, plant = watched_pair(effort)
    after, runs = 400, effort.runs(600)
    for number, (kind, size) in enumerate(SIZES):
        fault = np.full(after, size) if kind == "bias" else size * np.arange(1.0, after + 1.0)
        z = plant.run(np.random.default_rng(9300 + number), runs, BEFORE + after)[0]
        z[:, BEFORE:, 0] += fault
        delays = [listen(one, one.engine(), z).only(Alarm.CELL).first(runs, BEFORE) for one in (on, off)]
        found = np.isfinite(delays[0]) & np.isfinite(delays[1])
        ours, theirs = float(delays[0][found].mean()), float(delays[1][found].mean())
        ratio, missed = ours / theirs, float(np.isinf(delays[0]).mean())
        what = f"{kind} of {size} sigma{'' if kind == 'bias' else ' a reading'}, reference plant, adaptation "
        what += f"on: {ours:.2f} readings, off: {theirs:.2f}" + (f", missed {missed:.1%}" if missed else "")
        result.rows.append(
            _row(f"delay.{kind}.{size}", what, ratio, "<= 1.05", ratio <= 1.05, "adaptation off")
        )


def first_names(assembly: Any, engine: Any, z: Floats) -> list[tuple[float, Kind, float]]:
    """Readings from the onset to the first name, the kind named, its size; infinite where nothing was."""
    told = []
    for readings in readings_of(assembly, z):
        engine.reset()
        reports = engine.process(readings)[BEFORE:]
        named = np.flatnonzero(reports["fault"][:, 0] != Kind.NONE)
        if not named.size:
            told.append((math.inf, Kind.NONE, 0.0))
            continue
        first = reports[named[0]]
        told.append((named[0] + 1.0, Kind(int(first["fault"][0])), float(first["fault_size"][0])))
    return told


def lying(plant: Plant, kind: Kind, size: float, runs: int, seed: int) -> Floats:
    """(runs, steps, 1) readings whose sensor errs from BEFORE on, for AFTER readings."""
    rng = np.random.default_rng(seed)
    z = plant.run(rng, runs, BEFORE + AFTER)[0]
    if kind is Kind.NOISE:
        z[:, BEFORE:, 0] += math.sqrt(size**2 - 1.0) * rng.standard_normal((runs, AFTER))
    else:
        z[:, BEFORE:, 0] += size
    return z


def oracle_share(plant: Plant, z: Floats, size: float, within: int, interval: float, effort: Effort) -> float:
    """Share of runs in which the CUSUM that lacks a bias's onset alone finds it so soon, names left out."""
    w = profile(plant, np.full(2 * AFTER, size))
    quiet_runs = plant.run(np.random.default_rng(9450), effort.runs(4000, 40), 1000)[0]
    h = threshold(settled_innovations(plant, quiet_runs), w, interval)
    return float(np.mean(delays_of(settled_innovations(plant, z), w, h, BEFORE) <= within))


def naming_rows(effort: Effort, result: Result, assembly: Any, plant: Plant) -> None:
    """What noise and bias are called, through the engine and its judge, onset unknown."""
    engine, runs = assembly.engine(), effort.runs(1000, 10)
    interval = assembly.config.faults.mean_time_between_false_alarms_s / assembly.resolved.process.step_s
    for number, (kind, size, within, often) in enumerate(NAMED):
        z = lying(plant, kind, size, runs, 9400 + number)
        told = first_names(assembly, engine, z)
        right = share(sum(one[1] is kind and one[0] <= within for one in told), runs)
        wrong = share(sum(one[1] not in (kind, Kind.NONE) for one in told), runs)
        label = f"{kind.name.lower()} {'x' if kind is Kind.NOISE else 'of '}{size:.3g}"
        identity = f"{kind.name.lower()}.{size:.3g}"
        median = float(np.median([one[2] for one in told if one[1] is kind] or [math.nan]))
        what = f"{label} sigma named as such within {within} readings; 95 % from "
        what += f"{right.low:.1%}; median size {median:.2f}"
        if kind is Kind.BIAS:
            best = oracle_share(plant, z, size, within, interval, effort)
            what += f"; a CUSUM that lacks the onset alone finds it in {best:.1%}"
            what += ", no detector in more" if best < often else ""
        row = _row(f"named.{identity}", what, right.value, f">= {often}", right.value >= often, "", "of runs")
        result.rows.append(row)
        what = f"{label} sigma called something else within {AFTER} readings; 95 % up to {wrong.high:.1%}"
        row = _row(f"misnamed.{identity}", what, wrong.value, "<= 0.02", wrong.value <= 0.02, "", "of runs")
        result.rows.append(row)


def tenth_rows(effort: Effort, result: Result, assembly: Any, plant: Any) -> None:
    """A sensor that declares a tenth of its true deviation."""
    runs = effort.runs(200, 10)
    z = plant.wrong(R=100.0).run(np.random.default_rng(9500), runs, 600)[0]
    engine, nis, refused = assembly.engine(), np.zeros((runs, 600)), np.zeros((runs, 600), dtype=bool)
    for run, readings in enumerate(readings_of(assembly, z)):
        engine.reset()
        reports = engine.process(readings)
        nis[run], refused[run] = reports["nis"], reports["verdict"] != 0
    at = nis[:, 150:200]
    error = 2.0 * float(at.mean(axis=1).std(ddof=1)) / math.sqrt(runs)
    value, early, late = float(at.mean()), float(nis[:, :20].mean()), float(nis[:, 200:].mean())
    what = f"a tenth of sigma declared: NIS in readings 150 to 200, +-{error:.3f}; 0 to 20 "
    what += f"{early:.2f}, after 200 {late:.3f}"
    result.rows.append(_row("tenth.nis", what, value, "1.0 +- 0.1", abs(value - 1.0) <= 0.1))
    rejected = float(refused[:, 200:].mean())
    what = (
        f"a tenth of sigma declared: refused after 200 readings; before {float(refused[:, :200].mean()):.2%}"
    )
    result.rows.append(_row("tenth.refused", what, rejected, "0", rejected == 0.0, "", "of readings"))


STEERED: dict[str, Any] = {
    "law": "lqg_integral", "rate_hz": 10.0, "controls": ["push"], "tracks": ["position"],
    "state_cost": {"position": 1.0, "velocity": 1.0}, "input_cost": {"push": 1.0},
    "integral_cost": {"position": 0.5}, "lowest": {"push": -1.0}, "highest": {"push": 1.0},
}  # fmt: skip
"""A law that commands with every reading."""
PUSHED: dict[str, Any] = {"inputs": ["push"], "B": [[0.005], [0.1]]}
"""What the law acts through."""


def measured(assembly: Assembly, z: Floats) -> Records:
    """What the sensors say; of the command the daemon tells itself, and the goal stays where it is."""
    readings = readings_of(assembly, z)[0]
    return np.ascontiguousarray(readings[readings["sensor"] == assembly.layout.numbers["y"]])


def step_costs(variants: dict[str, Any], rounds: int) -> dict[str, Floats]:
    """(rounds,) us a reading of every configuration, on the same readings, in turn within a round."""
    plant = plant_of(configuration())
    z = plant.run(np.random.default_rng(9600), 1, 20_000)[0]
    assemblies = [assembled(one) for one in variants.values()]
    ready = [(one.engine(), measured(one, z)) for one in assemblies]
    costs = np.zeros((len(ready), rounds + 1))
    for k in range(rounds + 1):
        for number, (engine, readings) in enumerate(ready):
            engine.reset()
            begun = time.process_time()
            engine.process(readings)
            costs[number, k] = (time.process_time() - begun) / len(readings) * 1e6
    return dict(zip(variants, costs[:, 1:], strict=True))  # the first round also loads what is compiled


def cost_rows(effort: Effort, result: Result) -> None:
    """What adaptation costs in the step, and what adaptation and a command with every reading cost together."""
    bare = {name: part for name, part in configuration().items() if name != "adaptation"}
    both = merged(configuration(), {"control": STEERED, "model": PUSHED})
    variants = {"off": bare, "on": configuration(), "both": both}
    costs = step_costs(variants, max(3, effort.runs(25, 3)))
    together = "adaptation and control (a command a reading) together"
    for name, identity, what in (("on", "cost", "adaptation"), ("both", "cost.both", together)):
        spent = float(np.median(costs[name] - costs["off"]))
        told = f"{what} in the step, constant velocity: {np.median(costs[name]):.2f} with, "
        told += f"{np.median(costs['off']):.2f} without; median of paired runs"
        result.rows.append(_row(identity, told, spent, "<= 1", spent <= 1.0, "", "us"))


def adaptation_part(effort: Effort) -> Result:
    """How near to the oracle, how consistent, and what it does to finding faults."""
    result = Result()
    steps_rows(effort, result)
    spread_row(effort, result)
    cost_rows(effort, result)
    return result


def adaptation_faults_part(effort: Effort) -> Result:
    """What adaptation does to delay, to naming, and to a sensor that declares too little."""
    result = Result()
    delay_rows(effort, result)
    config = merged(sensed(REFERENCE, {"y": 1.0}, 36_000.0), {"adaptation": {}})
    assembly, plant = assembled(config), plant_of(config)
    naming_rows(effort, result, assembly, plant)
    tenth_rows(effort, result, assembly, plant)
    return result


__all__: Sequence[str] = ("adaptation_faults_part", "adaptation_part")
