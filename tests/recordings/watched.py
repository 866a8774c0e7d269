"""Recordings run with fault detection: configurations of configs/, with what detection needs of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond import config
from fusiond.assembly.assembly import Assembly, assemble
from fusiond.demo.injecting import inject_into
from fusiond.recording.log import open_log
from fusiond.types import Health, Kind
from tools.pages.recorded import CONFIGS

NAMED = (Health.FAULTY, Health.EXCLUDED)


@dataclass(frozen=True)
class Watched:
    """A log and a configuration that looks for faults."""

    assembly: Assembly
    log: Path

    def run(self, *faults: str, until_s: float = np.inf) -> NDArray[Any]:
        """Reports of a run with these faults injected, up to a time since the first reading."""
        source = open_log(self.log, self.assembly.layout)
        lies = inject_into(source, self.assembly, faults, 0) if faults else source
        engine, begin_ns = self.assembly.engine(), None
        reports = []
        for chunk in lies:
            begin_ns = int(chunk["t_ns"][0]) if begin_ns is None else begin_ns
            kept = chunk[(chunk["t_ns"] - begin_ns) * 1e-9 <= until_s]
            reports.append(engine.process(kept.copy()).copy())
        return np.concatenate(reports)

    def named(self, reports: NDArray[Any]) -> set[tuple[str, str]]:
        """Every sensor that was ever called faulty or excluded, with the kind of its fault."""
        return {
            (sensor.name, Kind(int(kind)).label)
            for sensor in self.assembly.layout.sensors
            for kind in np.unique(reports["fault"][np.isin(reports["health"][:, sensor.number], NAMED), sensor.number])
        }  # fmt: skip

    def sensor(self, name: str) -> int:
        """Number of a sensor."""
        return self.assembly.layout.numbers[name]


def since_s(reports: NDArray[Any]) -> NDArray[np.float64]:
    """Stamps since the first one."""
    return np.asarray((reports["t_ns"] - reports["t_ns"][0]) * 1e-9)


def watched(name: str, log: Path, changes: Mapping[str, str]) -> Watched:
    """configs/NAME.toml with these texts exchanged, each of which occurs once, and robust detection."""
    text = (CONFIGS / f"{name}.toml").read_text(encoding="utf-8")
    for old, new in changes.items():
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    if "[faults]" not in text:
        text += '\n[faults]\nprofile = "robust"\n'
    return Watched(assemble(config.parse(text, name), CONFIGS), log)
