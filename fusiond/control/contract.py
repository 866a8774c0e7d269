"""What a control law is: one Python file with a description and kernels.

describe(process, setting, **parameters) -> Law
command(x, desk, at, c, u)     writes the command u wanted in the state x, before any limit
cost(x, desk, at, c) -> float  what desk.command, done in the state x, costs until the next; 0 where nothing says so

A kernel reads the controller's part of the desk (engine.records.desk_dtype): reference; queue, the commands that have
not acted yet, oldest first; wanted and done, the last command as it was wanted and as it was done. The only field it
may write is memory. A law that keeps nothing there keeps nothing between calls.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from fusiond.control.plant import Plan
from fusiond.numerics.riccati import Matrix
from fusiond.types import Slot


@dataclass(frozen=True, slots=True)
class Motion:
    """One control period of the process model: x+ = F x + B u + w, w ~ N(0, W)."""

    F: Matrix
    B: Matrix
    W: Matrix


@dataclass(frozen=True, slots=True)
class Setting:
    """What a law is told of where it runs.

    Args:
        period_s: time between two commands.   discrete: the process model knows no time between its steps.
        motion: the process model over one period, linearised where its inputs have these values, by name with unit,
            and the others are 0.
    """

    period_s: float
    discrete: bool
    motion: Callable[[Mapping[str, float]], Motion]


@dataclass(frozen=True, slots=True)
class Law:
    """A control law, described against one process model.

    Args:
        controls: numbers of the command.   references: numbers of the reference it follows; none: it needs none.
        reads: names of the states it reads, in the order of `at`.   parameters: handed to the kernels as c.
        memory: numbers it keeps in the desk.   queue: commands that have not acted yet when the next one is computed.
        drives: the controls are inputs of the process model, so that the command drives the prediction.
        plan: plant, gains and cost, where the law was designed from them.
    """

    controls: tuple[Slot, ...]
    references: tuple[Slot, ...]
    reads: tuple[str, ...]
    parameters: tuple[float, ...] = ()
    memory: int = 0
    queue: int = 0
    drives: bool = False
    plan: Plan | None = None
