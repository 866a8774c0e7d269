"""Who is named, how large and since when: isolation and identification with the judge on."""

from __future__ import annotations

from collections import Counter

import numpy as np

from fusiond.assembly.assembly import Assembly
from fusiond.faults.diagnosability import matrix
from fusiond.types import Kind
from tools.scoreboard.bands import share
from tools.scoreboard.board import Effort, Result, Row
from tools.scoreboard.false_alarms import reference
from tools.scoreboard.judging import Verdict, judged, settled_of
from tools.scoreboard.plants import VELOCITY, Floats, Plant, plant_of, sensed
from tools.scoreboard.watching import Integers, assembled

ONSET, AFTER = 100, 80
NOISE = 0.1
PROMISED_S = 36_000.0


def biased(plant: Plant, runs: int, sigmas: float, seed: int) -> tuple[Floats, Integers]:
    """Readings with a bias from ONSET on in the sensors by turns, and (runs,) which."""
    rng = np.random.default_rng(seed)
    z = plant.run(rng, runs, ONSET + AFTER)[0]
    who = np.arange(runs, dtype=np.int64) % len(plant.H)
    for run, sensor in enumerate(who):
        z[run, ONSET:, sensor] += sigmas * np.sqrt(plant.R[sensor])
    return z, who


def confusion(found: list[Verdict], who: Integers, sensors: int) -> Floats:
    """(s, s + 2) runs: by the sensor that erred, each sensor named, then a set, then nothing."""
    counts = np.zeros((sensors, sensors + 2))
    for verdict, truth in zip(found, who, strict=True):
        if len(verdict.named) == 1:
            counts[truth, verdict.named[0]] += 1
        elif len(verdict.named) > 1 or len(verdict.suspects) > 1:
            counts[truth, sensors] += 1
        else:
            counts[truth, sensors + 1] += 1
    return counts


def ambiguous(assembly: Assembly) -> bool:
    """Whether the diagnosability matrix says that some bias cannot be told from another sensor's."""
    detection = assembly.detection
    assert detection is not None
    rows = matrix(detection.course, detection.signatures, detection.promise, detection.tests)
    biases = [row for row in rows if row.kind is Kind.BIAS and not row.suspect.is_input]
    inputs = {row.suspect.sensor for row in rows if row.suspect.is_input}
    return any(set(row.ambiguous) - inputs for row in biases)


def isolable_rows(effort: Effort, result: Result) -> None:
    """Three equal sensors on an integrator, and two on a stable plant: each can be told from the others."""
    three = sensed(VELOCITY, {f"y{k}": NOISE for k in (1, 2, 3)}, PROMISED_S)
    equal = ("constant velocity, three sensors", assembled(three), plant_of(three))
    two = ("reference plant, two sensors", *reference(PROMISED_S, "sharp"))
    for number, (case, sigmas) in enumerate(((equal, 6.0), (two, 6.0), (equal, 3.0))):
        name, assembly, plant = case
        z, who = biased(plant, effort.runs(150, 12), sigmas, 6000 + number)
        found = judged(assembly, assembly.engine(), z, ONSET)
        counts = confusion(found, who, len(plant.H))
        named = counts[:, : len(plant.H)]
        wrong = int(named.sum() - np.trace(named))
        band = share(wrong, len(found))
        told = f"wrong sensor named, bias of {sigmas:.0f} sigma, {name}; 95 % up to {band.high:.1%}; "
        told += f"named {named.sum() / len(found):.1%}, a set {counts[:, -2].sum() / len(found):.1%}"
        result.rows.append(
            Row(f"6.wrong.{number}", told, band.value, "of runs", "", None, "<= 0.01", band.value <= 0.01)
        )
        if sigmas == 6.0:
            result.curves[f"confusion.{name}"] = {
                "counts": counts.tolist(), "ambiguous": [ambiguous(assembly)],
            }  # fmt: skip
        if case is equal:
            identified(result, plant, z, who, found, sigmas)


def identified(
    result: Result, plant: Plant, z: Floats, who: Integers, found: list[Verdict], sigmas: float
) -> None:
    """Kind, error and onset as told with the right name, over what the readings up to then allow.

    The bound counts every reading of the step the name is told in, the estimate those up to the sensor's own.
    """
    settled = settled_of(plant)
    kinds: Counter[str] = Counter()
    errors, ours, best = [], [], []
    for run, (verdict, truth) in enumerate(zip(found, who, strict=True)):
        if verdict.named != (truth,):
            continue
        kinds[verdict.kind.name] += 1
        size = sigmas * np.sqrt(plant.R[truth])
        bound = 1.0 / np.sqrt(settled.information(int(truth), verdict.step - ONSET + 1)[-1])
        errors.append((verdict.error - size) / bound)
        ours.append(abs(verdict.onset - ONSET))
        best.append(abs(settled.likely_onset(z[run], int(truth), size, verdict.step) - ONSET))
    identity = "" if sigmas == 6.0 else f".{sigmas:.0f}"
    name = f"told with the name, bias of {sigmas:.0f} sigma, constant velocity, three sensors"
    other = share(kinds.total() - kinds[Kind.BIAS.name], kinds.total())
    told = f"kind {name}: another than bias; 95 % up to {other.high:.1%}; {dict(kinds)}"
    result.rows.append(
        Row(f"6.kind{identity}", told, other.value, "of runs", "", None, "<= 0.02", other.value <= 0.02)
    )
    spread = float(np.sqrt(np.nanmean(np.square(errors))))
    told = f"error {name}: rms of what it is off by / Cramer-Rao (onset known)"
    result.rows.append(
        Row(f"6.size{identity}", told, spread, "", "Cramer-Rao", spread, "<= 1.15", spread <= 1.15)
    )
    mean, bound = float(np.mean(ours)), float(np.mean(best))
    ratio = mean / bound if bound > 0.0 else (1.0 if mean == 0.0 else float("inf"))
    told, against = f"onset {name}: mean absolute error", f"likeliest onset, size known: {bound:.3f}"
    result.rows.append(Row(f"6.onset{identity}", told, mean, "steps", against, ratio, "<= 1.3", ratio <= 1.3))


def ambiguous_rows(effort: Effort, result: Result) -> None:
    """Two equal sensors on an integrator: nothing tells them apart."""
    config = sensed(VELOCITY, {"y1": NOISE, "y2": NOISE}, PROMISED_S)
    assembly, plant = assembled(config), plant_of(config)
    z, who = biased(plant, effort.runs(60, 12), 6.0, 6100)
    found = judged(assembly, assembly.engine(), z, ONSET)
    exact = sum(not verdict.named and verdict.suspects == (0, 1) for verdict in found)
    named = sum(bool(verdict.named) for verdict in found)
    band = share(exact, len(found))
    told = f"the exact set told, bias of 6 sigma, constant velocity, two equal sensors; 95 % from {band.low:.1%}; "
    told += f"one was named in {named} of {len(found)}"
    result.rows.append(Row("6.set", told, band.value, "of runs", "", None, "1", exact == len(found)))
    result.curves["confusion.constant velocity, two sensors"] = {
        "counts": confusion(found, who, 2).tolist(), "ambiguous": [ambiguous(assembly)],
    }  # fmt: skip


def naming_part(effort: Effort) -> Result:
    """Isolation and identification."""
    result = Result()
    isolable_rows(effort, result)
    ambiguous_rows(effort, result)
    return result
