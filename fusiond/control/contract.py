"""What a control law is: one Python file with a description and a kernel.

describe(process, **parameters) -> Law
command(x, reference, at, c, u)     writes the command u from the state x; keeps nothing between calls
"""

from __future__ import annotations

from dataclasses import dataclass

from fusiond.types import Slot


@dataclass(frozen=True, slots=True)
class Law:
    """A control law, described against one process model.

    Args:
        controls: numbers of the command.   references: numbers of the reference it follows.
        reads: names of the states it reads, in the order of `at`.   parameters: handed to the kernel as c.
    """

    controls: tuple[Slot, ...]
    references: tuple[Slot, ...]
    reads: tuple[str, ...]
    parameters: tuple[float, ...] = ()
