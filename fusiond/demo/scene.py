"""What there is to see at one moment: gathered from the daemon's outputs and the plant's own account of the truth."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fusiond.simulation.faults import Fault, Kind
from fusiond.types import NANOSECONDS, seconds

REMEMBERED = 200
"""Truths and estimates kept until the other of the same time comes: six seconds."""


@dataclass(frozen=True, slots=True)
class Setting:
    """What does not change during a demonstration.

    Args:
        units: of every state, by name.      goal: of the position, m; None where nobody steers.
        faults: that are injected, in its own time.
        watched: the state drawn over time, or two drawn over each other.
    """

    name: str
    duration_s: float
    goal_m: float | None
    units: Mapping[str, str]
    endpoint: str
    pids: Mapping[str, int]
    faults: tuple[Fault, ...] = ()
    watched: tuple[str, ...] = ("position",)


@dataclass(slots=True)
class Scene:
    """One moment, and the way there.

    Args:
        estimate, control, status: newest messages of the daemon.      truth: at the estimate's time.
        path: (t_s, truth, estimate) of the first watched state so far.      plan: (truth, truth, estimate, estimate) of
            both, where there are two.
    """

    setting: Setting
    estimate: Mapping[str, Any] | None = None
    control: Mapping[str, Any] | None = None
    status: Mapping[str, Any] | None = None
    truth: Mapping[str, float] | None = None
    end: Mapping[str, Any] | None = None
    path: list[tuple[float, float, float]] = field(default_factory=list)
    plan: list[tuple[float, float, float, float]] = field(default_factory=list)
    plant_t_ns: int = 0
    _truths: dict[int, Mapping[str, float]] = field(default_factory=dict)
    _estimates: dict[int, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def t_s(self) -> float:
        """The plant's time, as far as the daemon knows it."""
        return 0.0 if self.estimate is None else float(self.estimate["t"])

    @property
    def injected_now(self) -> list[str]:
        """The faults that are on at the plant's time, with how long they stay; a short one is shown for a second."""
        now_ns, said = self.plant_t_ns, []
        for fault in self.setting.faults:
            one = fault.kind is Kind.SPIKE and fault.duration_ns is None
            end_ns = fault.start_ns if one else fault.end_ns
            if fault.start_ns <= now_ns < max(end_ns, fault.start_ns + NANOSECONDS):
                until = "" if one or fault.duration_ns is None else f" until {seconds(fault.end_ns):g} s"
                said.append(f"{fault} (since {seconds(fault.start_ns):g} s{until})")
        return said

    def told(self, line: Mapping[str, Any]) -> None:
        """Take a line of the plant."""
        if "end" in line:
            self.end = line
            return
        t_ns = self.plant_t_ns = int(line["t_ns"])
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
        if value is None:
            return None
        apart = float(value) - self.truth[name]
        return math.remainder(apart, 2.0 * math.pi) if self.setting.units.get(name) == "rad" else apart

    def _compare(self, t_ns: int) -> None:
        for kept in (self._truths, self._estimates):
            while len(kept) > REMEMBERED:
                del kept[next(iter(kept))]
        if t_ns not in self._truths or t_ns not in self._estimates:
            return
        estimate, truth = self._estimates.pop(t_ns), self._truths.pop(t_ns)
        self.estimate, self.truth = estimate, truth
        watched, state = self.setting.watched, estimate["state"]
        if not all(name in state and name in truth for name in watched):
            return
        self.path.append((float(estimate["t"]), truth[watched[0]], float(state[watched[0]])))
        if len(watched) == 2:
            x, y = watched
            self.plan.append((truth[x], truth[y], float(state[x]), float(state[y])))
