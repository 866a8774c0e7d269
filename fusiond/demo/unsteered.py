"""Systems that nobody steers: what their sensors measure is simulated first, then sent in real time.

The truth is told as it passes and written whole into a file, never sent over Zenoh, where the daemon is.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fusiond.errors import ConfigError
from fusiond.simulation.registry import simulate
from fusiond.simulation.tables import Simulation, Truth
from fusiond.types import NANOSECONDS


@dataclass(frozen=True, slots=True)
class Unsteered:
    """What a demonstration of such a system shows and promises.

    Args:
        watched: the state drawn over time, or the two that are drawn over each other.
        own_noise: what moves it and what its sensors add is the filter's own model, so that the mean NIS is held from
            below too; otherwise the filter may be less sure of a quiet moment than it could be.
    """

    watched: tuple[str, ...]
    own_noise: bool


UNSTEERED: Mapping[str, Unsteered] = {
    "ground_vehicle": Unsteered(("y",), own_noise=False),
    "reference_plant": Unsteered(("x1",), own_noise=True),
    "square_robot": Unsteered(("x", "y"), own_noise=False),
    "square_robot_gyro": Unsteered(("x", "y"), own_noise=False),
    "wall_robot": Unsteered(("position",), own_noise=True),
}


def run_of(name: str, seed: int, duration_s: float, inject: Sequence[str]) -> Simulation:
    """One simulated run with its faults. Raises: ConfigError."""
    if name not in UNSTEERED:
        raise ConfigError(f"demo {name}: nothing simulates it; choose one of {', '.join(sorted(UNSTEERED))}")
    return simulate(name, seed, duration_s, inject=inject)


@dataclass(slots=True)
class Playing:
    """One run in real time, at its own stamps.

    Args:
        publish: by sensor.      tell: gets a line of JSON for whoever watches.      now_ns, sleep: the clock.
    """

    run: Simulation
    duration_ns: int
    publish: Mapping[str, Callable[[tuple[float, ...], int], None]]
    tell: Callable[[dict[str, Any]], None]
    now_ns: Callable[[], int] = time.monotonic_ns
    sleep: Callable[[float], None] = time.sleep
    stopping: bool = False
    t_ns: int = 0
    worst_behind_ns: int = 0
    sent: dict[str, int] = field(default_factory=dict)

    def play(self) -> None:
        """Send everything, or until stopped."""
        self.sent = dict.fromkeys(self.publish, 0)
        begin_ns = self.now_ns()
        truth, row = self.run.truth, 0
        for reading in self.run.readings:
            if self.stopping:
                return
            if reading.t_ns > self.t_ns:
                row = self._tell_until(truth, row, self.t_ns)
                self._wait(begin_ns + reading.t_ns)
                self.t_ns = reading.t_ns
            self.publish[reading.sensor](reading.z, reading.t_ns)
            self.sent[reading.sensor] += 1
        self._tell_until(truth, row, self.duration_ns)
        self._wait(begin_ns + self.duration_ns)
        self.t_ns = self.duration_ns

    def summary(self) -> dict[str, Any]:
        """The last line told."""
        behind_s = self.worst_behind_ns / NANOSECONDS
        return {
            "end": True,
            "t_ns": self.t_ns,
            "sent": self.sent,
            "worst_behind_s": behind_s,
            "paused_s": 0.0,
        }

    def _tell_until(self, truth: Truth, row: int, t_ns: int) -> int:
        """Tell the rows up to this time; returns the next row."""
        end = int(np.searchsorted(truth.t_ns, t_ns, side="right"))
        for k in range(row, end):
            values = dict(zip(truth.names, truth.values[k].tolist(), strict=True))
            self.tell({"t_ns": int(truth.t_ns[k]), **values})
        return end

    def _wait(self, due_ns: int) -> None:
        behind_ns = self.now_ns() - due_ns
        if behind_ns < 0:
            self.sleep(-behind_ns / NANOSECONDS)
        self.worst_behind_ns = max(self.worst_behind_ns, behind_ns)
