"""What a process model and a sensor model are: one Python file each, a description and its kernels.

A process model file has
    describe(**parameters) -> Process            plain Python, once, at design time; its signature is its configuration
and, where the model is linear and time-invariant,
    discretise(dt_s, p, F, B, c, G, q)           writes x+ = F x + B u + c + G w, w ~ N(0, diag(q))
otherwise
    transition(x, u, dt_s, p, x_next, F, B)      writes x_next = f(x, u) and its Jacobians F = df/dx, B = df/du
    noise(x, dt_s, p, G, q)                      writes the noise columns and variances
and, where the state is no vector (Process.errors given),
    add_error(x, dx, p)                          x <- x [+] dx, in place
    error_between(x, y, p, dx)                   writes dx with x [+] dx = y
and, where vectors of the world turn with the heading (Process.turning.follows),
    turn_error(x, dx, p, J)                      x <- x [+] dx where they do; J, the identity, becomes what that does to
                                                 the error, unit upper triangular
and, with outputs,
    derive(x, p, y)                              writes the derived outputs
A sensor model file has
    describe(process, **parameters) -> Sensor
    observe(x, z, at, p, h, H) -> bool           writes h(x) and H = dh/dx; False where z carries an unknown index

Kernels are decorated with `fusiond.numerics.kernel.kernel`. F, B, c, G and H come zeroed. The same contract
holds for a user's own file.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fusiond.errors import ConfigError
from fusiond.types import Slot


def by_name(slots: tuple[Slot, ...], name: str) -> Slot:
    """The slot of that name; raises ConfigError with what there is."""
    for slot in slots:
        if slot.name == name:
            return slot
    raise ConfigError(f"no state `{name}`; the process model has {', '.join(slot.name for slot in slots)}")


@dataclass(frozen=True, slots=True)
class Turning:
    """What turns when the world is turned about the vertical: the heading, and with it every horizontal vector.

    Nothing that a body measures on itself can tell one such world from another. In the slots of the error:

    Args:
        heading: the angle about the vertical, rad.   pairs: horizontal vectors in the axes of the world.
        guarded: what is learned through the heading, itself included, and guarded unless the configuration says
            otherwise (fusiond.engine.step.guard_on).
        follows: the model has `turn_error`.
    """

    heading: str
    pairs: tuple[tuple[str, str], ...]
    guarded: tuple[str, ...] = ()
    follows: bool = False


@dataclass(frozen=True, slots=True)
class Process:
    """A process model, described.

    Args:
        states, inputs: slots with units.    noises: columns of G.
        errors: slots of the error state where it is no vector: F, G, H and the covariance are of these. The states
            whose error is a plain difference come first in both, in the same order.
        origin: the state where the configuration gives none; zeros by default.
        parameters: flat vector handed to the kernels as p.
        linear: the model is linear and time-invariant and has `discretise`.
        angles: names of states that live on a circle, rad.    outputs: derived outputs that `derive` writes.
        step_s: the model is discrete and knows only whole multiples of this step; 0 for continuous time.
        max_step_s: longest interval one transition may span (a coarser prediction is split); 0 unlimited.
        turning: what turns with the world; None where the model knows no heading.
    """

    states: tuple[Slot, ...]
    inputs: tuple[Slot, ...] = ()
    noises: int = 0
    parameters: tuple[float, ...] = ()
    linear: bool = False
    angles: tuple[str, ...] = ()
    outputs: tuple[Slot, ...] = ()
    step_s: float = 0.0
    max_step_s: float = 0.0
    errors: tuple[Slot, ...] = ()
    origin: tuple[float, ...] = ()
    turning: Turning | None = None

    @property
    def error_slots(self) -> tuple[Slot, ...]:
        """Slots of the error: the states themselves where nothing else is said."""
        return self.errors or self.states

    def has(self, *names: str) -> bool:
        """Whether every named state exists."""
        known = {slot.name for slot in self.states}
        return all(name in known for name in names)

    def slot(self, name: str) -> Slot:
        """The state of that name; raises ConfigError with what there is."""
        return by_name(self.states, name)


@dataclass(frozen=True, slots=True)
class Sensor:
    """A sensor model, described against one process model.

    Args:
        channels: what one reading carries, with units, an index included.
        reads: names of the states that `observe` reads, in the order of its argument `at`.
        measured: how many of the leading channels are measurements (an index follows them); None for all.
        wraps: names of measured channels that are angles, rad.
        parameters: flat vector handed to the kernel as p.
        indices: the values an index may take.
    """

    channels: tuple[Slot, ...]
    reads: tuple[str, ...]
    measured: int | None = None
    wraps: tuple[str, ...] = ()
    parameters: tuple[float, ...] = ()
    indices: tuple[float, ...] = ()

    @property
    def dof(self) -> int:
        """Channels that are compared with the state."""
        return len(self.channels) if self.measured is None else self.measured


def flatten(rows: Sequence[Sequence[float]]) -> tuple[float, ...]:
    """The numbers of a matrix, row by row, as a parameter vector."""
    return tuple(float(value) for row in rows for value in row)


def shape_of(name: str, matrix: Any, rows: int, columns: int | None = None) -> tuple[int, int]:
    """Check a matrix from the configuration; returns its shape or raises ConfigError naming what is wrong."""
    widths = {len(row) for row in matrix}
    if len(matrix) != rows or len(widths) != 1 or (columns is not None and widths != {columns}):
        wanted = f"{rows} x {columns if columns is not None else 'any'}"
        have = f"{len(matrix)} rows of {sorted(widths)}"
        raise ConfigError(f"{name}: has {have} numbers, needs {wanted}; write it as a list of rows")
    return rows, widths.pop()
