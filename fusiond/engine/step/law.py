"""Control law of a configuration without control: never called."""

from __future__ import annotations

from typing import Any

from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Vector


@kernel
def command(x: Vector, desk: Any, at: Vector, c: Vector, u: Vector) -> None:
    """Leave the command as it is."""


@kernel
def cost(x: Vector, desk: Any, at: Vector, c: Vector) -> float:
    """It costs nothing."""
    return 0.0
