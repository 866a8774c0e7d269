"""What was learnt of the sensors' noise, as numbers that outlive the engine: by sensor, R / declared by channel."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from fusiond.engine.engine import Engine
from fusiond.types import Role

Learnt = Mapping[str, Mapping[str, Any]]
"""By sensor: `trusted` and `slow`, ratios by decorrelated channel."""
FIELDS = ("trusted", "slow")
PARTS = 2
"""Whose innovations a trusted ratio rests on: those of the primary filter, and of the sensor's own."""


def learnt(engine: Engine) -> dict[str, dict[str, list[float]]]:
    """The ratios now; empty without adaptation, and before the first reading.

    The slow ones are those of the engine that judges: a plain one has none of its own.
    """
    if engine.layout.shape.adapt is None:
        return {}
    noise = engine.track[0]["noise"]
    slow = (engine.judging or engine).track[0]["noise"]["slow"]
    found = {}
    for sensor in engine.layout.sensors:
        dof = engine.dof(sensor.number)
        if sensor.role is Role.UPDATE and noise["begun"][sensor.number]:
            found[sensor.name] = {
                "trusted": noise["trusted"][0, sensor.number, :dof].tolist(),
                "slow": slow[sensor.number, :dof].tolist(),
            }
    return found


def recall(engine: Engine, known: Learnt) -> None:
    """Let an engine that has had no reading begin with what was learnt before; what does not fit is left out.

    So does the one that judges for it, which would else hold noise as it always is for noise that has changed.
    """
    if engine.layout.shape.adapt is None:
        return
    if engine.judging is not None:
        recall(engine.judging, known)
    noise = engine.track[0]["noise"]
    for name, ratios in known.items():
        number = engine.layout.numbers.get(name)
        if number is None or not _fit(ratios, engine.dof(number)):
            continue
        dof = engine.dof(number)
        lowest, highest, forget = engine.noise_limits(number)
        for i in range(dof):
            for k in range(PARTS):
                noise["trusted"][k, number, i] = min(max(ratios["trusted"][i], lowest[i]), highest[i])
            noise["slow"][number, i] = min(max(ratios["slow"][i], lowest[i]), highest[i])
            noise["slow_weight"][number, i] = 0.5 / (1.0 - forget)
        noise["begun"][number] = 1


def _fit(ratios: Mapping[str, Any], dof: int) -> bool:
    """Whether both fields hold one positive number for each channel."""
    fields = [ratios.get(field) for field in FIELDS]
    return all(
        isinstance(values, list)
        and len(values) == dof
        and all(isinstance(v, float | int) and math.isfinite(v) and v > 0 for v in values)
        for values in fields
    )
