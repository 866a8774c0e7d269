"""What LQG control costs over what it was expected to cost, and what a sensor's loss and a limit do to it.

The reference plant, cost y^2 + 0.1 u^2, closed around the engine's compiled step. Costs are means over one long run;
their intervals, 99 %, are those of means of blocks of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from fusiond.assembly.assembly import Assembly
from tools.pages.trials import configured
from tools.scoreboard.board import Effort, Result, Row
from tools.scoreboard.closing import Closed, World
from tools.scoreboard.plants import Floats

NAME, SENSORS = "reference_plant_lqg", ("y1", "y2")
WEIGHT = 0.1
EXPECTED = {
    "delay 0": 1.42942, "delay 1": 1.90517, "delay 2": 2.07992, "delay 3": 2.12876,
    "both": 1.34142, "without y2": 1.42942, "without y1": 1.58845,
}  # fmt: skip
"""J*, to five decimals, by an independent computation."""
STEPS, BLOCKS, SURE = 3_000_000, 300, 2.576
FIRST, AFTER = 200, 50
"""Steps with both sensors before a loss; readings after it from which on the loop has settled."""
LIMIT = 1.0
CYCLE = 200
"""Steps of one round of losing a sensor and getting it back."""
FREE: dict[str, Any] = {"lowest": {"u": -1e6}, "highest": {"u": 1e6}, "fade_s": 0.0}


@cache
def _assembled(changes: tuple[tuple[str, Any], ...]) -> Assembly:
    control = {name: dict(value) if isinstance(value, tuple) else value for name, value in changes}
    return configured(NAME, {"filter": {"leave_one_out": False, "local_filters": False}, "control": control})


def assembly_with(**control: Any) -> Assembly:
    """The configuration with these settings of its control, one filter, nothing watched."""
    settings = FREE | control
    frozen = {k: tuple(v.items()) if isinstance(v, Mapping) else v for k, v in settings.items()}
    return _assembled(tuple(sorted(frozen.items())))


def world_of(assembly: Assembly, delay: int = 0) -> World:
    """The plant as its configuration says it."""
    model = dict(assembly.config.model)
    A, B = np.array(model["A"]), np.array(model["B"])[:, 0]
    R = tuple(float(s.R[0, 0]) for s in assembly.resolved.sensors if s.name in SENSORS)
    return World(A, B, np.array([1.0, 0.0, 0.0]), float(model["Q"][0][0]), R, delay)


def expected(assembly: Assembly, *working: str) -> float:
    """J* of a set of working sensors, as `fusiond check` prints it."""
    costs = {one.working: one.cost for one in assembly.expected_costs}
    cost = costs[frozenset(working)]
    assert cost is not None
    return cost


def mean_and_interval(cost: Floats, blocks: int = BLOCKS) -> tuple[float, float]:
    """Mean, and half of its interval, from means of blocks."""
    usable = len(cost) // blocks * blocks
    means = cost[:usable].reshape(blocks, -1).mean(axis=1)
    return float(cost.mean()), float(SURE * means.std(ddof=1) / np.sqrt(blocks))


def regulated(
    assembly: Assembly, there: tuple[bool, bool], steps: int, seed: int, delay: int = 0
) -> tuple[Floats, Floats]:
    """y and u of so many steps with these sensors, from AFTER readings after the others were lost."""
    loop, rng = Closed(assembly, world_of(assembly, delay), SENSORS), np.random.default_rng(seed)
    loop.steps(rng, np.ones((FIRST, 2), dtype=np.bool_))
    left = np.tile(np.array(there), (AFTER + steps, 1))
    y, u = loop.steps(rng, left)
    return y[AFTER:], u[AFTER:]


def cost_row(name: str, told: str, J: float, y: Floats, u: Floats) -> list[Row]:
    """Two rows: J* as predicted, and the measured cost over it."""
    cost = y**2 + WEIGHT * u**2
    mean, half = mean_and_interval(cost)
    exact = EXPECTED[name]
    key = name.replace(" ", "")
    return [
        Row(f"5.control.predicted.{key}", f"J* printed by `fusiond check`, {told}", J, "", "independent computation",
            J / exact, f"{exact} to 1e-5", abs(J - exact) <= 1e-5),
        Row(f"5.control.cost.{key}", f"measured cost over J*, {told}; {len(y):,} steps, +- {half / J:.4f} (99 %)",
            mean, "", "J*", mean / J, "1.00 within its interval", abs(mean - J) <= half),
    ]  # fmt: skip


def cost_rows(effort: Effort, result: Result) -> None:
    """Every delay, and every set of sensors."""
    steps = effort.runs(STEPS, 30_000)
    for delay in range(4):
        assembly = assembly_with(delay_s=float(delay))
        y, u = regulated(assembly, (True, False), steps, 9000 + delay, delay)
        told = f"one sensor, command {delay} steps late"
        result.rows += cost_row(f"delay {delay}", told, expected(assembly, "y1"), y, u)
    assembly = assembly_with()
    sets = {"both": (True, True), "without y2": (True, False), "without y1": (False, True)}
    for place, (name, there) in enumerate(sets.items()):
        y, u = regulated(assembly, there, steps, 9100 + place)
        working = [sensor for sensor, reads in zip(SENSORS, there, strict=True) if reads]
        told = f"two sensors, R = 1 and 2, {name}" + (
            "" if all(there) else f", from {AFTER} readings after the loss"
        )
        result.rows += cost_row(name, told, expected(assembly, *working), y, u)


def rounds(fade_s: float, rounds: int, seed: int) -> tuple[Floats, Floats]:
    """y and u (rounds, CYCLE): y1 is lost at step CYCLE / 2 of every round and comes back at its end."""
    assembly = assembly_with(fade_s=fade_s)
    loop, rng = Closed(assembly, world_of(assembly), SENSORS), np.random.default_rng(seed)
    there = np.ones((CYCLE, 2), dtype=np.bool_)
    there[CYCLE // 2 :, 0] = False
    y, u = loop.steps(rng, np.tile(there, (rounds, 1)))
    return y.reshape(rounds, CYCLE), u.reshape(rounds, CYCLE)


def switch_rows(effort: Effort, result: Result) -> None:
    """What the switch itself costs, with and without the fade."""
    assembly = assembly_with()
    least, most = expected(assembly, "y1", "y2"), expected(assembly, "y2")
    count = effort.runs(2500, 50)
    for fade_s in (0.0, 3.0):
        y, u = rounds(fade_s, count, 9200)
        cost = (y**2 + WEIGHT * u**2)[1:]
        after = cost[:, CYCLE // 2 : CYCLE // 2 + AFTER].mean(axis=1)
        half = SURE * after.std(ddof=1) / np.sqrt(len(after))
        name = f"cost in the {AFTER} readings after y1 is lost, fade {fade_s:g} s; {len(after):,} losses, "
        name += f"+- {half:.3f} (99 %); "
        name += f"settled {least:.4f} before, {most:.4f} after"
        result.rows.append(
            Row(f"5.control.switch.fade{fade_s:g}", name, float(after.mean()), "", "J* after the loss",
                float(after.mean()) / most, "reported", True)
        )  # fmt: skip
        result.curves[f"control.switch.{fade_s:g}"] = {
            "step": list(range(-20, 60)),
            "cost": cost[:, CYCLE // 2 - 20 : CYCLE // 2 + 60].mean(axis=0).tolist(),
        }


def saturation_rows(effort: Effort, result: Result) -> None:
    """A command that may not exceed LIMIT: the cost, and that the estimate does not mind."""
    steps = effort.runs(STEPS // 6, 20_000)
    assembly = assembly_with(lowest={"u": -LIMIT}, highest={"u": LIMIT})
    y, u = regulated(assembly, (True, True), steps, 9300)
    J = expected(assembly, *SENSORS)
    mean, half = mean_and_interval(y**2 + WEIGHT * u**2)
    share = float(np.mean(np.abs(u) >= LIMIT - 1e-12))
    name = f"cost with u limited to +-{LIMIT:g}, at its limit {share:.0%} of the time; "
    name += f"{steps:,} steps, +- {half:.4f} (99 %)"
    result.rows.append(
        Row("5.control.saturation", name, mean, "", "J* without limit", mean / J, "reported", True)
    )


def control_part(effort: Effort) -> Result:
    """The cost of control."""
    result = Result()
    cost_rows(effort, result)
    switch_rows(effort, result)
    saturation_rows(effort, result)
    return result
