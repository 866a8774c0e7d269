"""One channel of an update where no state is guarded."""

from __future__ import annotations

from typing import Any

from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import bierman_update


@kernel
def fuse(U: Any, d: Any, sensor: int, i: int, nu: float, design: Any, work: Any) -> float:
    """Fuse channel i of work.H, R_d into U, d and work.dx; returns S, writes its gain times S into work.b."""
    return bierman_update(work.dx, U, d, work.H[i], work.R_d[i], nu, work.a, work.b)


@kernel
def note_learning(track: Any, design: Any, work: Any, S: float) -> None:
    """Note what the last channel taught the guarded states."""


@kernel
def unobserved_states(track: Any, design: Any, now_ns: int) -> int:
    """The guarded states that nothing teaches now, a bit for each slot of the error."""
    return 0


@kernel
def begin_learning(track: Any, work: Any) -> None:
    """Before the channels of one reading."""


@kernel
def forget_learning(track: Any, work: Any) -> None:
    """The channels noted since `begin_learning` were not used after all."""
