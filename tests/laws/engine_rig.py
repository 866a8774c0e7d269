"""A small engine that the laws of the engine share: its every variation runs on one compiled step.

Two states, an input that drives the velocity, and three sensors of which two send two numbers; values in the
configuration may change, sizes may not, so that nothing is compiled again.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from fusiond.assembly.assembly import Assembly, assemble
from fusiond.config import parse
from fusiond.engine.engine import Engine
from fusiond.engine.layout import Layout
from fusiond.engine.records import HAS_ARRIVAL, HAS_R, HAS_SEQ
from fusiond.types import TICK

MS = 1_000_000
SECOND = 1000 * MS
A = ((0.0, 1.0), (-0.4, -0.3))
B = ((0.0,), (1.0,))
G = ((1.0, 0.0), (0.0, 1.0))
Q = ((0.02, 0.01), (0.01, 0.3))
H = {"a": ((1.0, 0.0), (0.0, 1.0)), "b": ((1.0, 0.5), (-0.2, 1.0)), "c": ((1.0, 0.0),)}
STD = {"a": (0.3, 0.5), "b": (0.2, 0.4), "c": (0.1,)}
INPUT_STD = 0.25
SENSORS = MappingProxyType(
    {
        name: {
            "kind": '"linear"',
            "H": [list(row) for row in H[name]],
            "noise_std": "{ " + ", ".join(f"z{i} = {std}" for i, std in enumerate(STD[name])) + " }",
        }
        for name in H
    }
)


def toml_of(
    *,
    model: Mapping[str, Any] = MappingProxyType({}),
    sensors: Mapping[str, Mapping[str, Any]] = MappingProxyType({}),
    sections: str = "",
    without: tuple[str, ...] = (),
) -> str:
    """The rig's configuration with changes.

    Args:
        model, sensors: settings that replace those of the rig, as TOML text or numbers.
        sections: more TOML.   without: sensors left out.
    """
    said: dict[str, Any] = {
        "kind": '"linear"', "states": '["position", "velocity"]', "inputs": '["acceleration"]',
        "A": [list(row) for row in A], "B": [list(row) for row in B], "G": [list(row) for row in G],
        "Q": [list(row) for row in Q],
    } | dict(model)  # fmt: skip
    drive = {
        "kind": '"input"', "drives": '["acceleration"]', "noise_std": f"{{ acceleration = {INPUT_STD} }}"
    }  # fmt: skip
    tables = {"model": said, "initial": {"std": "{ position = 2.0, velocity = 1.0 }"}}
    for name, section in {"drive": drive, **SENSORS}.items():
        if name not in without:
            tables[f"sensor.{name}"] = {**section, **sensors.get(name, {})}
    tables["control"] = {
        "law": '"pd"', "rate_hz": 10.0, "proportional_gain_n_m": 2.0, "derivative_gain_n_s_m": 1.0,
        "limit_n": 3.0,
    }  # fmt: skip
    lines = ['name = "rig"']
    for title, settings in tables.items():
        lines += [f"[{title}]", *(f"{name} = {value}" for name, value in settings.items())]
    return "\n".join([*lines, sections])


@functools.cache
def assembled(text: str) -> Assembly:
    """Assemble a configuration once."""
    return assemble(parse(text, "rig"), Path())


def rig(**changes: Any) -> Engine:
    """A fresh engine of the rig; see `toml_of`."""
    return assembled(toml_of(**changes)).engine()


def reading(
    layout: Layout,
    sensor: str,
    t_ns: int,
    z: Any,
    *,
    seq: int | None = None,
    R: Any = None,
    arrival_ns: int | None = None,
) -> Any:
    """One reading record, (1,)."""
    record = np.zeros(1, layout.reading)
    values = np.atleast_1d(np.asarray(z, dtype=float))
    record["t_ns"], record["sensor"], record["length"] = t_ns, layout.numbers[sensor], len(values)
    kept = values[: layout.shape.payload]
    record["z"][0, : len(kept)] = kept
    if seq is not None:
        record["seq"] = seq
        record["flags"] |= HAS_SEQ
    if R is not None:
        matrix = np.atleast_2d(np.asarray(R, dtype=float))
        record["R"][0, : len(matrix), : len(matrix)] = matrix
        record["flags"] |= HAS_R
    if arrival_ns is not None:
        record["arrival_ns"] = arrival_ns
        record["flags"] |= HAS_ARRIVAL
    return record


def tick(layout: Layout, t_ns: int) -> Any:
    """One tick, (1,)."""
    record = np.zeros(1, layout.reading)
    record["t_ns"], record["sensor"] = t_ns, TICK
    return record


def one(engine: Engine, *said: Any, **more: Any) -> Any:
    """Run one reading through the engine; returns a copy of its report."""
    return engine.process(reading(engine.layout, *said, **more))[0].copy()


def stream(
    layout: Layout, count: int, seed: int = 0, *, step_ns: int = 10 * MS, distinct: bool = False
) -> Any:
    """Readings of every sensor at irregular stamps, (count,): some equal, unless they shall be distinct."""
    rng = np.random.default_rng(seed)
    names = [sensor.name for sensor in layout.sensors if sensor.name not in {"applied", "reference"}]
    records, t_ns = [], SECOND
    for _ in range(count):
        t_ns += int(rng.integers(int(distinct), 3)) * step_ns // 2
        name = names[rng.integers(len(names))]
        length = len(layout.sensors[layout.numbers[name]].channels)
        records.append(reading(layout, name, t_ns, rng.standard_normal(length)))
    return np.concatenate(records)


def filters(engine: Engine) -> dict[str, Any]:
    """Copies of x, U, d and the time of every filter, the bank's included."""
    track = engine.track[0]
    return {name: track[name].copy() for name in ("x", "U", "d", "filter_t_ns")}
