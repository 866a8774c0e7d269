"""Control law of a configuration without control: never called."""

from __future__ import annotations

from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Vector


@kernel
def command(x: Vector, reference: Vector, at: Vector, c: Vector, u: Vector) -> None:
    """Leave the command as it is."""
