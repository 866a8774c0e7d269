"""Closed loops while a sensor lies, and the car's J-turn: is the goal kept, or the plant made safe in time?"""

from __future__ import annotations

from collections import Counter

from fusiond.assembly.assembly import load
from tools.pages.loop_faults import CATALOGUE, PLANTS, TIMES, FaultLoop, Outcome
from tools.pages.trials import CONFIGS, configured
from tools.pages.yaw_tracking import turn
from tools.scoreboard.board import Effort, Result, Row

FAULT_FREE = 8
"""Runs without a fault, from whose mean square its distance is taken."""
SPEEDS_KM_H = (60.0, 90.0, 120.0)


def outcomes(name: str, effort: Effort) -> tuple[float, list[Outcome]]:
    """Fault-free distance from the goal, m, and what became of the faults of the catalogue."""
    assembly = load(CONFIGS / f"{name}.toml")
    loop = FaultLoop(assembly.engine(), assembly.design[0], name)
    fault_free_m = loop.fault_free_m(effort.runs(FAULT_FREE, 2))
    chosen = list(CATALOGUE.items())[: effort.runs(len(CATALOGUE), 3)]
    return fault_free_m, [loop.outcome(fault, inject, fault_free_m) for fault, inject in chosen]


def fault_rows(effort: Effort, result: Result) -> None:
    """A row for each plant, and one for the commands."""
    unsafe: Counter[str] = Counter()
    for name in PLANTS:
        fault_free_m, found = outcomes(name, effort)
        for one in found:
            unsafe.update(one.unsafe)
        good = sum(one.ok for one in found)
        kept, safe = sum(one.kept for one in found), sum(one.in_time for one in found)
        missed = [f"{one.name} ({one.times:.1f} x)" for one in found if not one.ok]
        told = f"{name}: goal kept within {TIMES:g} x the fault-free {1e3 * fault_free_m:.2f} mm ({kept} faults), or "
        told += f"safe in the configured time ({safe}), of {len(found)} faults, one run each"
        told += f"; neither: {', '.join(missed)}" if missed else ""
        result.rows.append(
            Row(f"5.control.faults.{name.removesuffix('_lqg')}", told, good / len(found), "of faults", "", None, "1",
                good == len(found))
        )  # fmt: skip
        result.curves[f"control.faults.{name}"] = {
            "name": [one.name for one in found],
            "times": [one.times for one in found],
            "farthest": [one.farthest_m for one in found],
            "kept": [one.kept for one in found],
            "safe": [one.safe_s for one in found],
            "in_time": [one.in_time for one in found],
        }
    count = float(sum(unsafe.values()))
    told = "commands in these runs that were not finite, beyond a limit, or of a stale, uncertain or invalid estimate"
    result.rows.append(Row("5.control.unsafe", told, count, "commands", "", None, "0", count == 0.0))


def turn_rows(result: Result) -> None:
    """The J-turn at the seed's three speeds, the law designed for the middle one."""
    engine = configured("single_track_lqg").engine()
    for speed in SPEEDS_KM_H:
        driven = turn(engine, speed)
        told = f"J-turn at {speed:g} km/h: yaw rate from a second after the ramp, error over what is wanted, root "
        told += "mean square; "
        told += f"largest error on the way {driven.largest:.1%}"
        result.rows.append(
            Row(f"5.control.jturn.{speed:g}", told, driven.steady_rms, "", "", None, "reported", True)
        )
        result.curves[f"control.jturn.{speed:g}"] = {
            "t": driven.t_s.tolist(), "wanted": driven.wanted.tolist(), "yaw_rate": driven.yaw_rate.tolist(),
        }  # fmt: skip


def loops_part(effort: Effort) -> Result:
    """Closed loops."""
    result = Result()
    fault_rows(effort, result)
    turn_rows(result)
    return result
