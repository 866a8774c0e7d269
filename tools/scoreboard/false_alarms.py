"""How often nothing was wrong: the measured mean time between false alarms over the promised one.

Every test is in the race; an alarm of any of them counts. Noise as declared, and wrong by a third.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fusiond.types import Alarm
from tools.pages.trials import configured
from tools.scoreboard.bands import Band, mean_interval
from tools.scoreboard.board import Effort, Result, Row
from tools.scoreboard.plants import STATIC, VELOCITY, Plant, plant_of, sensed
from tools.scoreboard.watching import assembled, listen

RUNS, STEPS = 8, 16_384
"""Runs side by side, steps of each: long enough that their beginning does not matter."""
WRONG: dict[str, dict[str, float]] = {
    "R x 1.3": {"R": 1.3}, "R x 0.7": {"R": 0.7}, "Q x 1.3": {"Q": 1.3}, "Q x 0.7": {"Q": 0.7},
    "R and Q x 1.3": {"R": 1.3, "Q": 1.3}, "R and Q x 0.7": {"R": 0.7, "Q": 0.7},
}  # fmt: skip
COLOURED = "successive noises correlated by 0.3"


@dataclass(frozen=True, slots=True)
class Quiet:
    """A healthy time: how long it was, in steps, and what was raised in it."""

    steps: int
    raised: Counter[str]

    def interval(self, *kinds: Alarm) -> Band:
        """Steps between alarms of these kinds, of any without them."""
        names = [kind.name for kind in kinds] or list(self.raised)
        return mean_interval(float(self.steps), sum(self.raised[name] for name in names))


def quiet(assembly: Any, plant: Plant, steps: int, seed: int) -> Quiet:
    """Run the plant without a fault for about so many steps."""
    rng, engine = np.random.default_rng(seed), assembly.engine()
    raised: Counter[str] = Counter()
    chunks = max(1, round(steps / (RUNS * STEPS)))
    for _ in range(chunks):
        alarms = listen(assembly, engine, plant.run(rng, RUNS, STEPS)[0])
        raised.update(Alarm(int(kind)).name for kind in alarms.kind)
    return Quiet(chunks * RUNS * STEPS, raised)


def reference(interval_s: float, profile: str) -> tuple[Any, Plant]:
    """configs/reference_plant.toml with this promise, and its plant."""
    section = {"mean_time_between_false_alarms_s": interval_s, "profile": profile}
    assembly = configured("reference_plant", {"faults": section})
    return assembly, plant_of(assembly.config.model_dump())


def kept(name: str, identity: str, found: Quiet, promised: float) -> Row:
    """The row of one promise kept; `promised` in steps."""
    band = found.interval()
    low, high, value = band.low / promised, band.high / promised, band.value / promised
    told = f"{name}; 95 % between {low:.2f} and {high:.2f}; {dict(found.raised)}"
    good = low >= 0.8 and high <= 1.5
    return Row(identity, told, value, "measured / promised", "the promise", value, "0.8 to 1.5", good)


def promise_part(effort: Effort) -> Result:
    """The promise at two lengths on the reference plant, and at one on two other plants."""
    result = Result(curves={"promise": {"name": [], "promised": [], "value": [], "low": [], "high": []}})
    cases: list[tuple[str, Any, Plant, float, int]] = []
    for profile, promised, steps in (
        ("sharp", 1e4, 2_400_000),
        ("sharp", 5e4, 12_000_000),
        ("robust", 1e4, 2_400_000),
    ):
        cases.append((f"reference plant, {profile}", *reference(promised, profile), promised, steps))
    others: list[tuple[str, Mapping[str, Any]]] = [
        ("one sensor of a known state", sensed(STATIC, {"y": 1.0}, 1e4)),
        ("constant velocity, one sensor", sensed(VELOCITY, {"y": 0.1}, 1e3)),
    ]
    for name, config in others:
        cases.append((name, assembled(config), plant_of(config), 1e4, 2_400_000))
    for number, (name, assembly, plant, promised, steps) in enumerate(cases):
        found = quiet(assembly, plant, effort.runs(steps, 1), 1000 + number)
        told = f"mean time between false alarms, every test, {name}, promised {promised:,.0f} samples"
        result.rows.append(kept(told, f"1.promise.{number}", found, promised))
        band = found.interval()
        for column, value in zip(
            ("name", "promised", "value", "low", "high"),
            (name, promised, band.value, band.low, band.high), strict=True,
        ):  # fmt: skip
            result.curves["promise"][column].append(value)  # type: ignore[attr-defined]
    return result


def wrong_noise_part(effort: Effort) -> Result:
    """The promise on the reference plant when the noise is not as declared: no shorter than a third of it."""
    result = Result(curves={"wrong": {"name": [], "profile": [], "value": [], "low": [], "high": []}})
    for profile in ("sharp", "robust"):
        assembly, plant = reference(1e4, profile)
        plants = {name: plant.wrong(**factors) for name, factors in WRONG.items()}
        plants[COLOURED] = plant.wrong(correlation=0.3)
        for number, (name, wrong) in enumerate(plants.items()):
            found = quiet(assembly, wrong, effort.runs(655_360, 1), 2000 + number)
            band = found.interval()
            value, low, high = band.value / 1e4, band.low / 1e4, band.high / 1e4
            told = f"the same, {profile}, {name}; 95 % between {low:.2f} and {high:.2f}; {dict(found.raised)}"
            published = name == COLOURED
            reach = "published" if published else ">= 1/3"
            row = Row(f"1.wrong.{profile}.{number}", told, value, "measured / promised", "the promise", value, reach,
                      published or value >= 1.0 / 3.0)  # fmt: skip
            result.rows.append(row)
            for column, one in zip(result.curves["wrong"], (name, profile, value, low, high), strict=True):
                result.curves["wrong"][column].append(one)  # type: ignore[attr-defined]
    return result
