"""Adaptation of a configuration: its sizes, its tables in the design record, and the fuzzy table in the cache."""

from __future__ import annotations

import hashlib
import json
import math
import os
import tempfile
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.adapt import fuzzy, fuzzy_design, variational
from fusiond.adapt.records import AdaptShape
from fusiond.assembly.package import cache_folder
from fusiond.assembly.plain import is_plain
from fusiond.assembly.resolve import Resolved, ResolvedSensor, by_key
from fusiond.assembly.turning import guarded_slots
from fusiond.config import AdaptationSection, FuzzySection, nearest
from fusiond.errors import ConfigError
from fusiond.types import Role

COARSE, FINE = 1.5, 1.1
"""Two levels of the ladder are no further apart than COARSE, and need be no nearer than FINE."""
SPACING = 6.4
"""Between the two: so many of sqrt(1 / readings between jumps), which is about four deviations of what can be known."""
PER_BIN = 9
"""Levels that share one filter."""
SMALL = 4
"""Largest state for which bins are kept."""
TILT = 0.3
"""Jumps prefer small levels a little: level R is jumped to as R^-TILT."""
MEAN_WINDOW = 50.0
"""Readings over which the mean is taken that the slow R leaves out."""
MOST_COLUMNS = 2
Floats = NDArray[np.float64]


def spacing(section: AdaptationSection) -> float:
    """Logarithm of the factor between two levels: the longer noise stays what it is, the better it can be known."""
    return min(math.log(COARSE), max(math.log(FINE), SPACING / math.sqrt(section.readings_between_jumps)))


def ladder(section: AdaptationSection) -> Floats:
    """Levels from floor to ceiling, evenly in their logarithm, as many for each bin."""
    span, bins = math.log(section.ceiling / section.floor), most_bins(section)
    per_bin = math.ceil((span / spacing(section) + 1.0) / bins - 1e-9)
    return np.geomspace(section.floor, section.ceiling, bins * per_bin)


def most_bins(section: AdaptationSection) -> int:
    """Bins of the ladder, each of no more than PER_BIN levels if these were COARSE."""
    span = math.log(section.ceiling / section.floor)
    return max(1, math.ceil((span / math.log(COARSE) + 1.0) / PER_BIN - 1e-9))


def bins_of(resolved: Resolved) -> int:
    """Filters that share the ladder; 0: one for all."""
    section, updating = resolved.config.adaptation, resolved.updating
    if (
        section is None
        or section.method != "interacting"
        or not section.separate_filters
        or is_plain(resolved.config)
    ):
        return 0
    single = len(updating) == 1 and updating[0].model.dof == 1
    process = resolved.process
    vector = not process.errors and len(process.error_slots) <= SMALL
    plainly = resolved.config.filter.covariance_hz is None and not guarded_slots(resolved)
    if not (single and vector and plainly and _adapts(updating[0])):
        return 0
    return most_bins(section)


def adaptation_of(resolved: Resolved) -> dict[str, Any]:
    """What adaptation does, for `fusiond check`; empty without it."""
    section = resolved.config.adaptation
    if section is None:
        return {}
    bins = bins_of(resolved)
    forms = {
        "interacting": f"{bins} filters share {len(ladder(section))} levels" if bins
        else f"one filter, {len(ladder(section))} levels a channel",
        "variational": f"over {section.window:g} readings",
        "fuzzy": f"{len(section.fuzzy.rules)} rules over {section.window:g} readings",
        "fuzzy_additive": f"3 rules over {section.window:g} readings, for comparison",
    }  # fmt: skip
    adapted = [sensor for sensor in resolved.updating if _adapts(sensor)]
    return {
        "method": section.method,
        "form": forms[section.method],
        "sensors": {
            sensor.name: {
                slot.key: [
                    math.sqrt(float(sensor.R[i, i] * max(section.floor, _quantised(sensor, i + 1)[i]))),
                    math.sqrt(float(sensor.R[i, i]) * section.ceiling),
                ]
                for i, slot in enumerate(sensor.model.channels[: sensor.model.dof])
            }
            for sensor in adapted
        },
        "as_declared": [sensor.name for sensor in resolved.updating if sensor not in adapted],
    }


def _adapts(sensor: ResolvedSensor) -> bool:
    """Whether this sensor's noise is estimated: it corrects the state, has noise, and nobody said no."""
    wanted = sensor.section is None or sensor.section.adapt_noise
    return sensor.role is Role.UPDATE and wanted and bool(np.all(np.diagonal(sensor.R) > 0.0))


def method_of(resolved: Resolved) -> str | None:
    """The module of `fusiond.adapt` that estimates noise; None without adaptation."""
    section = resolved.config.adaptation
    return None if section is None else section.method


def adapt_shape(resolved: Resolved) -> AdaptShape | None:
    """Sizes of the records; None without adaptation."""
    section = resolved.config.adaptation
    match method_of(resolved):
        case None:
            return None
        case "interacting":
            assert section is not None
            levels = len(ladder(section))
            return AdaptShape(memory=levels, levels=levels, bins=bins_of(resolved))
        case "variational":
            return AdaptShape(memory=variational.MEMORY)
        case "fuzzy":
            assert section is not None
            rows, columns = fuzzy_design.axes_of(rules_of(section.fuzzy))
            return AdaptShape(memory=fuzzy.MEMORY, rows=len(rows), columns=len(columns))
        case _:
            return AdaptShape(memory=fuzzy.MEMORY, rows=fuzzy_design.ROWS, columns=MOST_COLUMNS)


def fill_noise(resolved: Resolved, record: np.record) -> None:
    """Write the tables of the estimation into the design record."""
    section = resolved.config.adaptation
    if section is None:
        return
    if section.floor >= section.ceiling:
        raise ConfigError(
            f"adaptation.floor: {section.floor} is no less than the ceiling {section.ceiling}; "
            "lower it, or raise the ceiling"
        )
    made = record["noise"]
    for number, sensor in enumerate(resolved.sensors):
        made["adapts"][number] = _adapts(sensor)
        made["floor"][number], made["ceiling"][number] = section.floor, section.ceiling
        made["floor"][number] = np.maximum(section.floor, _quantised(sensor, len(made["floor"][number])))
    made["most"] = math.log(section.largest_change)
    made["forget"] = 1.0 - 1.0 / section.window
    made["slow_forget"] = 1.0 - 1.0 / section.slow_window
    made["mean_share"] = 1.0 / min(MEAN_WINDOW, section.slow_window)
    made["window"] = section.window
    if section.method == "interacting":
        _fill_ladder(section, made)
        if bins_of(resolved):
            made["binned"] = resolved.sensors.index(resolved.updating[0])
            made["bin_jump"] = np.add.reduceat(made["jump"][made["binned"], 0], made["bin_first"][:-1])
    elif section.method.startswith("fuzzy"):
        _fill_table(section, made)


def _quantised(sensor: ResolvedSensor, payload: int) -> Floats:
    """(m,) the variance of rounding to the sensor's resolution, as a share of the declared one."""
    share = np.zeros(payload)
    if sensor.section is None or sensor.role is not Role.UPDATE:
        return share
    steps = by_key(sensor.section.resolution, sensor.model.channels, f"sensor.{sensor.name}.resolution")
    for i, slot in enumerate(sensor.model.channels[: min(payload, sensor.model.dof)]):
        declared = float(sensor.R[i, i])
        if declared > 0.0:
            share[i] = min(1.0, steps.get(slot.name, 0.0) ** 2 / 12.0 / declared)
    return share


def _fill_ladder(section: AdaptationSection, made: np.record) -> None:
    """Levels, where they jump to, and how often; below a sensor's own floor nothing jumps."""
    level = ladder(section)
    made["level"] = level
    made["hazard"] = 1.0 / section.readings_between_jumps
    weight = np.where(level >= made["floor"][..., None] * (1.0 - 1e-9), level**-TILT, 0.0)
    made["jump"] = weight / weight.sum(axis=-1, keepdims=True)
    made["bin_first"] = np.arange(len(made["bin_first"])) * (len(level) // most_bins(section))


def rules_of(section: FuzzySection) -> fuzzy_design.Rules:
    """The operator's sets and rules; raises ConfigError where a rule names a set that is none."""
    kinds = {"scatter": section.scatter, "mean": section.mean, "change": section.change}
    for number, rule in enumerate(section.rules):
        for (kind, sets), word in zip(kinds.items(), rule, strict=True):
            if word not in sets and not (word == fuzzy_design.ANY and kind != "change"):
                subject = f"adaptation.fuzzy.rules[{number}]"
                raise ConfigError(f"{subject}: `{word}` is no set of {kind}; {nearest(word, sets)}")
        if rule[0] == rule[1] == fuzzy_design.ANY:
            raise ConfigError(
                f"adaptation.fuzzy.rules[{number}]: asks for nothing; name a set of scatter or of mean"
            )
    for kind, sets in kinds.items():
        for name, corners in sets.items():
            if list(corners) != sorted(corners):
                raise ConfigError(
                    f"adaptation.fuzzy.{kind}.{name}: {corners} goes back; write its corners from left to right"
                )
    return fuzzy_design.Rules(section.scatter, section.mean, section.change, section.rules)


def _cached(what: object, make: Callable[[], Floats]) -> Floats:
    """The table derived from `what` by scikit-fuzzy, from the cache or made now."""
    source = Path(fuzzy_design.__file__).read_text(encoding="utf-8")
    said = json.dumps([what, version("scikit-fuzzy"), np.__version__, source], sort_keys=True)
    place = cache_folder() / "designs" / f"fuzzy-{hashlib.sha256(said.encode()).hexdigest()[:24]}.npy"
    if place.is_file():
        return np.asarray(np.load(place))
    table = make()
    place.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=place.parent, suffix=".npy", delete=False) as draft:
        np.save(draft, table)
    os.replace(draft.name, place)
    return table


def _fill_table(section: AdaptationSection, made: np.record) -> None:
    """The control surface, in ln R a reading, or for the published design in declared variances a reading."""
    step = section.fuzzy.step
    if section.method == "fuzzy":
        rules = rules_of(section.fuzzy)
        made["table"] = step * _cached(
            section.fuzzy.model_dump(exclude={"step"}), lambda: fuzzy_design.table_of(rules)
        )
        made["row_at"], made["column_at"] = fuzzy_design.axes_of(rules)
    else:
        made["table"] = step * _cached("matching", fuzzy_design.matching_table)
        made["row_at"] = np.linspace(*fuzzy_design.MATCHING, fuzzy_design.ROWS)
        made["column_at"] = 0.0, 1.0
