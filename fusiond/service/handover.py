"""What one daemon hands on to the next: the engine's memory, the numbers of what went out, the health last told."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from fusiond import __version__
from fusiond.assembly.assembly import Assembly
from fusiond.assembly.trial import Trial
from fusiond.engine.checkpoint import checkpoint, resume
from fusiond.engine.engine import Engine
from fusiond.service.health_watch import HealthWatch
from fusiond.service.outputs import Outputs
from fusiond.service.twin import Said

OWN = {"service", "recording"}
"""Sections in which the configurations of two daemons of one group may differ."""


def identity_of(assembly: Assembly) -> str:
    """Same for two daemons that compute the same: version, configuration, sizes of the records."""
    config = assembly.config.model_dump(mode="json", exclude=OWN)
    said = json.dumps([__version__, config, assembly.layout.track.descr, assembly.layout.desk.descr])
    return hashlib.sha256(said.encode()).hexdigest()


class Handover:
    """Gives and takes what a daemon must know to go on as another."""

    def __init__(self, assembly: Assembly, engine: Engine, outputs: Outputs, watch: HealthWatch) -> None:
        self._engine, self._outputs, self._watch = engine, outputs, watch
        self._identity = identity_of(assembly)
        self._trial = Trial(assembly.resolved)

    def give(self) -> bytes:
        """A checkpoint of this daemon."""
        notes = {"outputs": self._outputs.marks(), "health": self._watch.known()}
        return checkpoint(self._engine, self._identity, notes)

    def take(self, data: bytes) -> None:
        """Go on from another daemon's checkpoint. Raises: ValueError."""
        notes = resume(self._engine, data, self._identity)
        self._outputs.go_on(notes["outputs"])
        self._watch.know(notes["health"])

    def announce(self, about: Mapping[str, Any], jump: tuple[int, Mapping[str, float]]) -> None:
        """Tell of a take-over, with the health of all at once."""
        t_ns = int(self._engine.desk["newest_t_ns"][0])
        self._outputs.took_over(t_ns, self._watch.service, about, jump)
        self._outputs.health(t_ns, self._watch)

    def jump(self, own: Said, other: Said) -> dict[str, float]:
        """What leads from another daemon's estimate to this one's of the same time, by error slot; empty: nothing."""
        if own.values == other.values or len(own.values) != len(other.values):
            return {}
        dx = self._trial.error(np.array(other.values), np.array(own.values))
        return dict(zip((slot.name for slot in self._engine.layout.errors), dx.tolist(), strict=True))

    def reset(self, jump: Mapping[str, float], resets: int) -> None:
        """Write a jump into the records, as the last of so many resets."""
        for records in self._engine.histories:
            records["resets"] = resets
            records["jump"] = list(jump.values())
