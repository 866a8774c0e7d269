"""What there is to see at one moment: gathered from the daemon's outputs and the plant's own account of the truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

REMEMBERED = 200
"""Truths and estimates kept until the other of the same time comes: six seconds."""


@dataclass(frozen=True, slots=True)
class Setting:
    """What does not change during a demonstration.

    Args:
        units: of every state, by name.      goal: of the position, m.
    """

    name: str
    duration_s: float
    goal_m: float
    units: Mapping[str, str]
    endpoint: str
    pids: Mapping[str, int]


@dataclass(slots=True)
class Scene:
    """One moment, and the way there.

    Args:
        estimate, control, status: newest messages of the daemon.      truth: at the estimate's time.
        path: (t_s, true position, estimated position) so far.
    """

    setting: Setting
    estimate: Mapping[str, Any] | None = None
    control: Mapping[str, Any] | None = None
    status: Mapping[str, Any] | None = None
    truth: Mapping[str, float] | None = None
    end: Mapping[str, Any] | None = None
    path: list[tuple[float, float, float]] = field(default_factory=list)
    _truths: dict[int, Mapping[str, float]] = field(default_factory=dict)
    _estimates: dict[int, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def t_s(self) -> float:
        """The plant's time, as far as the daemon knows it."""
        return 0.0 if self.estimate is None else float(self.estimate["t"])

    def told(self, line: Mapping[str, Any]) -> None:
        """Take a line of the plant."""
        if "end" in line:
            self.end = line
            return
        t_ns = int(line["t_ns"])
        self._truths[t_ns] = {name: float(value) for name, value in line.items() if name != "t_ns"}
        self._compare(t_ns)

    def estimated(self, message: Mapping[str, Any]) -> None:
        """Take an estimate; it is shown with its truth, whichever of the two comes first."""
        t_ns = int(message["t_ns"])
        self._estimates[t_ns] = message
        self._compare(t_ns)
        if message["health"] != "nominal":
            # What is wrong is shown at once, without a truth to compare.
            self.estimate, self.truth = message, None

    def show_counts_of(self, final: Mapping[str, Any], during: Mapping[str, Any] | None) -> None:
        """Take the final status, with the rates and the health of an earlier one."""
        kept = {} if during is None else during["sensors"]
        sensors = {
            name: sensor | {what: kept[name][what] for what in ("rate_hz", "health") if name in kept}
            for name, sensor in final["sensors"].items()
        }
        self.status = {**final, "sensors": sensors}

    def error(self, name: str) -> float | None:
        """estimate - truth of one state, None where either is unknown."""
        if self.estimate is None or self.truth is None or name not in self.truth:
            return None
        value = self.estimate["state"].get(name)
        return None if value is None else float(value) - self.truth[name]

    def _compare(self, t_ns: int) -> None:
        for kept in (self._truths, self._estimates):
            while len(kept) > REMEMBERED:
                del kept[next(iter(kept))]
        if t_ns not in self._truths or t_ns not in self._estimates:
            return
        estimate, truth = self._estimates.pop(t_ns), self._truths.pop(t_ns)
        self.estimate, self.truth = estimate, truth
        if "position" in estimate["state"]:
            self.path.append((float(estimate["t"]), truth["position"], float(estimate["state"]["position"])))
