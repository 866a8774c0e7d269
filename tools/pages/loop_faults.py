"""The mini car and the bi-rotor in a closed loop while a sensor lies: every fault of the catalogue that applies.

One run: from rest to the goal, a fault at BEGIN_S, judged over the last seconds. The engine hears the sensors in the
order of their stamps, the force is its last command (in a safe state the safe one); time passes without readings too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fusiond.control.levels import Level
from fusiond.engine.engine import Engine
from fusiond.simulation.faults import parse_faults
from fusiond.simulation.faults_injection import Injection
from fusiond.simulation.rig import STEP_NS, PointRig, birotor, minicar
from fusiond.types import NANOSECONDS, TICK, Health, Role
from tools.pages.trials import records

BEGIN_S, LAST_S, DURATION_S = 10.0, 5.0, 30.0
TICK_NS = 50_000_000
"""The daemon's ticks, 20 Hz: only where nothing came meanwhile."""
LOST_S = 0.1
"""A correction older than this is none."""
TIMES = 3.0
"""Goal kept: so many times the fault-free distance, root mean square."""

PLANTS: dict[str, tuple[Callable[[int], PointRig], float]] = {
    "minicar_lqg": (minicar, 2.0), "birotor_lqg": (birotor, 0.75),
}  # fmt: skip
"""Plant and goal, m, of each configuration."""
CATALOGUE: dict[str, str] = {
    "range step": "ultrasonic.bias=0.5@10",
    "range step, 5 s": "ultrasonic.bias=2@10+5",
    "range noise x4": "ultrasonic.noise=4@10",
    "range noise x10": "ultrasonic.noise=10@10",
    "range frozen": "ultrasonic.stuck@10",
    "range off, 3 s": "ultrasonic.broken@10+3",
    "range off": "ultrasonic.broken@10",
    "range drift": "ultrasonic.drift=0.05@10",
    "range not a number": "ultrasonic.nan@10",
    "range spike": "ultrasonic.spike=5@10",
    "range scale": "ultrasonic.scale=1.07@10",
    "range late": "ultrasonic.delay=0.15@10",
    "range now and then": "ultrasonic.intermittent=0.3@10",
    "acceleration bias, small": "accelerometer.bias=0.3@10",
    "acceleration bias, 5 m/s2": "accelerometer.bias=5@10",
    "acceleration bias, 1 g": "accelerometer.bias=9.81@10",
    "acceleration noise x4": "accelerometer.noise=4@10",
    "acceleration frozen": "accelerometer.stuck@10",
    "acceleration off": "accelerometer.broken@10",
    "acceleration off, 3 s": "accelerometer.broken@10+3",
    "acceleration not a number": "accelerometer.nan@10",
    "acceleration spike": "accelerometer.spike=100@10",
    "acceleration spike, 10 readings": "accelerometer.bias=100@10+0.01",
    "acceleration drift": "accelerometer.drift=0.1@10",
}
"""What applies to two such sensors of the faults that other estimators' own tests and users name: steps, outages,
frozen values, noise, drifts, spikes, scale, timing, not a number, data now and then."""


@dataclass(frozen=True, slots=True)
class FaultRun:
    """One run. Arrays have a row for each millisecond.

    Args:
        position_m: the truth.   commands: (k, 5) t_s, force, valid, age of the last correction, largest deviation of
            position, of each command.   unsafe: commands that were valid and should not have been, by reason.
    """

    t_s: Any
    position_m: Any
    commands: Any
    unsafe: dict[str, int]

    def rms_m(self, goal_m: float) -> float:
        """Distance from the goal over the last seconds."""
        late = self.t_s >= self.t_s[-1] - LAST_S
        return float(np.sqrt(np.mean((self.position_m[late] - goal_m) ** 2)))

    def farthest_m(self, goal_m: float) -> float:
        """Largest distance from the goal since the fault."""
        return float(np.abs(self.position_m[self.t_s >= BEGIN_S] - goal_m).max())

    def safe_after_s(self) -> float | None:
        """Time from the fault to the safe state that lasted to the end; None where commands went on."""
        valid = self.commands[:, 2] > 0
        if valid[-1]:
            return None
        return float(self.commands[np.flatnonzero(valid)[-1] + 1, 0] - BEGIN_S) if valid.any() else 0.0

    def lost_after_s(self) -> float | None:
        """Time from the fault until no sound sensor corrected the state any more, to the end; None where one did."""
        sound = (self.commands[:, 4] > 0) & (self.commands[:, 3] < LOST_S)
        if sound[-1]:
            return None
        last = np.flatnonzero(sound)
        at = self.commands[last[-1] + 1] if last.size else self.commands[0]
        return float(at[0] - at[3] * (at[4] > 0) - BEGIN_S)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one fault.

    Args:
        times: distance from the goal over the last seconds, over the fault-free one.   kept: the goal was.
        safe_s: from the loss of the last sound sensor to the safe state, None where commands went on to the end.
        in_time: so soon as configured.
    """

    name: str
    times: float
    farthest_m: float
    kept: bool
    safe_s: float | None
    in_time: bool
    unsafe: dict[str, int]

    @property
    def ok(self) -> bool:
        """Goal kept or safe in time, and no command that should not have been."""
        return (self.kept or self.in_time) and not self.unsafe


class FaultLoop:
    """One configuration's engine, closed around its plant as often as asked."""

    def __init__(self, engine: Engine, design: Any, name: str, seed: int = 0) -> None:
        self.engine, self._design, self._seed = engine, design, seed
        self._rig, self.goal_m = PLANTS[name]

    def fault_free_m(self, runs: int, duration_s: float = DURATION_S) -> float:
        """Distance from the goal over the last seconds without a fault, root mean square of so many runs."""
        each = [self.run([], duration_s, self._seed + k).rms_m(self.goal_m) for k in range(runs)]
        return float(np.sqrt(np.mean(np.square(each))))

    def run(self, inject: Sequence[str], duration_s: float = DURATION_S, seed: int | None = None) -> FaultRun:
        """From rest to the goal with these faults."""
        self.engine.reset()
        seed = self._seed if seed is None else seed
        rig = self._rig(seed)
        rig.faults = Injection(parse_faults(inject), rig.measured, seed, origin_ns=0)
        steps = round(duration_s * NANOSECONDS / STEP_NS)
        position, commands = np.zeros(steps + 1), []
        unsafe: dict[str, int] = {}
        force_n, heard_ns = rig.plant.weight_n, 0
        tick = np.zeros(1, self.engine.layout.reading)
        tick["sensor"] = TICK
        for step in range(steps + 1):
            now = rig.advance(force_n) if step else rig.begin()
            given = records(self.engine.layout, now)
            if len(given):
                heard_ns = rig.t_ns
            elif rig.t_ns - heard_ns >= TICK_NS and (rig.t_ns - heard_ns) % TICK_NS == 0:
                tick["t_ns"], given = rig.t_ns, tick
            for one in given:
                report = self.engine.process(one.reshape(1))[0]
                if report["command_due"]:
                    force_n = float(report["command"][0])
                    commands.append(self._account(rig.t_ns, report, unsafe))
            position[step] = rig.state.position_m
        return FaultRun(np.arange(steps + 1) * 1e-3, position, np.array(commands), unsafe)

    def _account(self, t_ns: int, report: Any, unsafe: dict[str, int]) -> tuple[float, ...]:
        """One command as a row; what is wrong with it goes into `unsafe`."""
        design, force = self._design, float(report["command"][0])
        valid = bool(report["command_valid"])
        age_ns = t_ns - int(self.engine.track[0]["update_ns"])
        reasons = {
            "not finite": not np.isfinite(force),
            "beyond its limits": not design["lowest"][0] - 1e-9 <= force <= design["highest"][0] + 1e-9,
        }
        if valid:
            longest_ns = int(design["dead_reckoning_ns"]) + int(design["reckoning_ns"])
            reasons["of a stale estimate"] = age_ns > longest_ns
            reasons["of an estimate that is none"] = not np.isfinite(report["x"]).all()
            reasons["of an uncertain estimate"] = bool((report["std"] > design["largest_std"]).any())
            reasons["of an invalid estimate"] = int(report["service"]) == int(Level.SAFE)
        for reason, holds in reasons.items():
            if holds:
                unsafe[reason] = unsafe.get(reason, 0) + 1
        healthy = report["health"] == int(Health.HEALTHY)
        sound = float(bool((healthy & (design["role"] == int(Role.UPDATE))).any()))
        return t_ns / NANOSECONDS, force, float(valid), age_ns / NANOSECONDS, sound

    @property
    def allowed_s(self) -> float:
        """Longest time from the loss of the last sound sensor to the safe state."""
        design = self._design
        reckoned_ns = int(design["dead_reckoning_ns"]) + int(design["reckoning_ns"])
        return (
            max(reckoned_ns, int(design["doubt_ns"])) + 2 * int(design["control_period_ns"])
        ) / NANOSECONDS

    def outcome(self, name: str, inject: str, fault_free_m: float) -> Outcome:
        """One fault of the catalogue."""
        run = self.run([inject])
        times = run.rms_m(self.goal_m) / fault_free_m
        safe, lost = run.safe_after_s(), run.lost_after_s()
        took = None if safe is None else safe - (lost or 0.0)
        in_time = took is not None and lost is not None and took <= self.allowed_s
        return Outcome(name, times, run.farthest_m(self.goal_m), times <= TIMES, took, in_time, run.unsafe)
