"""A configuration whose R is as declared: the hooks of the step, each doing nothing.

`assembly` copies `adapt_on.py` over this file where the configuration asks for adaptation.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.numerics.kernel import kernel

from .guard import fuse


@kernel
def begin_noise(track: Any, design: Any) -> None:
    """The first reading is about to be applied."""


@kernel
def prepare(track: Any, design: Any, work: Any, row: int, t_ns: int) -> None:
    """Filter `row` has been predicted to a reading."""


@kernel
def trust(track: Any, design: Any, work: Any, row: int, sensor: int) -> None:
    """work.R_d holds the noise that filter `row` is about to be told of."""


@kernel
def declared_variance(track: Any, work: Any, sensor: int, i: int, variance: float) -> float:
    """The declared variance of raw channel i, of which `variance` is used."""
    return variance / (1.0 + track.reaction.noise_excess[sensor])


@kernel
def fuse_channel(track: Any, design: Any, work: Any, row: int, sensor: int, i: int, nu: float) -> float:
    """Fuse channel i into filter `row`; returns the S of its gain, writes the gain times S into work.b."""
    return fuse(track.U[row], track.d[row], sensor, i, nu, design, work)


@kernel
def gate_width(work: Any) -> float:
    """By how much the squared distance from which a reading is refused is to be larger than with the trusted R."""
    return 1.0


@kernel
def root_of(work: Any, i: int, S: float) -> float:
    """Deviation that is expected of channel i's innovation, fused with a gain of variance S."""
    return np.sqrt(S)


@kernel
def scale_slowly(track: Any, work: Any, sensor: int, dof: int) -> None:
    """work.e, root go to the monitors."""
