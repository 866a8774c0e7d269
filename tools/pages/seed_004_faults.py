"""Seed 004's own experiment: a node lies or falls silent, under four topologies, with isolation and without.

Three equal sensors on the reference plant, the readings of each seed the same for every topology. One sensor is biased,
drifts or breaks from START_S on; figures are the root mean square error of all states together from then to the end,
over that of the same topology on the same readings with no fault and no isolation.

python -m tools.pages.seed_004_faults    measure the table and print it (some minutes)
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fusiond.assembly.assembly import Assembly
from fusiond.demo.injecting import inject_into
from fusiond.engine.engine import Engine
from fusiond.simulation.registry import simulate
from fusiond.simulation.tables import Simulation
from tools.pages.seed_004_modes import PRIOR, Q
from tools.pages.trials import configured, errors, records

TOPOLOGIES = {
    "seed_averaged": "seed's average", "centralized": "centralized", "federated": "federated",
    "covariance_intersection": "covariance intersection",
}  # fmt: skip
START_S, END_S, SEEDS = 100, 300, 8
FAULTS = {
    "none": (), "bias": (f"y1.bias=6@{START_S}",), "drift": (f"y1.drift=0.1@{START_S}",),
    "broken node": (f"y1.broken@{START_S}",),
}  # fmt: skip
WORDS = {"bias": "bias of 6 sigma", "drift": "drift of 0.1 sigma a step", "broken node": "broken node"}
R = (1.0, 1.0, 1.0)


def plant(topology: str, isolated: bool) -> Assembly:
    """configs/reference_plant.toml with three equal sensors, one topology, and its faults looked for or not."""
    sensor = {
        "kind": "linear",
        "H": [[1.0, 0.0, 0.0]],
        "channels": ["y"],
        "rate_hz": 1.0,
        "noise_std": {"y": 1.0},
    }
    faults = {"mean_time_between_false_alarms_s": 36000.0} if isolated else None
    changes: Mapping[str, Any] = {
        "model": {"Q": [[Q]]},
        "sensor": {f"y{i}": sensor for i in (1, 2, 3)},
        "initial": {"std": None, "covariance": PRIOR},
        "fusion": {"topology": topology},
        "faults": faults,
    }
    return configured("reference_plant", changes)


def squared_error(assembly: Assembly, engine: Engine, simulation: Simulation, fault: str) -> float:
    """Mean square error of all states together from START_S on, one sample a stamp."""
    engine.reset()
    given = records(engine.layout, simulation.readings)
    given = given[np.lexsort((given["sensor"], given["t_ns"]))]
    lying = inject_into([given], assembly, FAULTS[fault], 0)
    told = np.concatenate(list(lying))
    reports = engine.process(told)
    wrong = errors(engine.layout, reports, simulation)
    last = np.append(np.flatnonzero(np.diff(told["t_ns"])), len(told) - 1)
    last = last[told["t_ns"][last] >= START_S * 1_000_000_000]
    return float(np.mean(np.sum(wrong[last] ** 2, axis=1)))


def measured(seeds: int = SEEDS) -> dict[tuple[str, str, bool], float]:
    """RMSE over fault-free, by (topology, fault, isolated); fault-free with isolation on is among them as `none`."""
    worlds = [simulate("reference_plant", seed, float(END_S), Q=Q, R=R) for seed in range(seeds)]
    found: dict[tuple[str, str, bool], float] = {}
    for topology in TOPOLOGIES:
        for isolated in (False, True):
            assembly = plant(topology, isolated)
            engine = assembly.engine()
            for fault in FAULTS:
                squares = [squared_error(assembly, engine, world, fault) for world in worlds]
                found[topology, fault, isolated] = float(np.sqrt(np.mean(squares)))
    clean = {topology: found[topology, "none", False] for topology in TOPOLOGIES}
    return {key: value / clean[key[0]] for key, value in found.items()}


def table(seeds: int = SEEDS) -> str:
    """The table, as Markdown."""
    found = measured(seeds)
    lines = [
        "| fault | isolation | " + " | ".join(TOPOLOGIES.values()) + " |",
        "|---|---|" + "---|" * len(TOPOLOGIES),
    ]
    for fault in FAULTS:
        for isolated in (False, True):
            if fault == "none" and not isolated:
                continue
            figures = " | ".join(f"{found[topology, fault, isolated]:.3f}" for topology in TOPOLOGIES)
            lines.append(f"| {WORDS.get(fault, fault)} | {'on' if isolated else 'off'} | {figures} |")
    return "\n".join(lines)


if __name__ == "__main__":
    print(table())
