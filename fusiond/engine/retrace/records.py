"""The records of a retraced run: what one update leaves behind, and the step's scratch with room for it."""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.engine.records import Shape, record, work_dtype


def pass_dtype(shape: Shape) -> np.dtype[Any]:
    """One update of the centralized filter, all that a smoother reads.

    t_ns: time of the state.   x, U, d: the state after the update, its error's covariance U diag(d) U'.
    apart: 1 where nothing leads here from the update before: the first after a start or a reset.
    F: (n, n) transition of the error from the update before to this one.
    channels: scalar updates made; of each of them h: (n,) its row of H, nu, S: innovation and variance,
    k: (n,) gain, zero where S is.
    """
    n, m = shape.errors, shape.payload
    return record(
        ("t_ns", "<i8"), ("apart", "<i4"), ("channels", "<i4"), ("x", "<f8", (shape.states,)),
        ("U", "<f8", (n, n)), ("d", "<f8", (n,)), ("F", "<f8", (n, n)),
        ("h", "<f8", (m, n)), ("k", "<f8", (m, n)), ("nu", "<f8", (m,)), ("S", "<f8", (m,)),
    )  # fmt: skip


def retrace_work_dtype(shape: Shape) -> np.dtype[Any]:
    """The step's scratch, and `pass_*`: the update in progress, J what it did to the error; `prior_*`: the covariance
    before it, `once`: an F.
    """
    n = shape.errors
    base: Any = work_dtype(shape)
    fields = [(name, base[name].base, base[name].shape) for name in base.names]
    more: Any = pass_dtype(shape)
    kept = [(f"pass_{name}", more[name].base, more[name].shape) for name in more.names]
    own = (
        ("prior_U", "<f8", (n, n)),
        ("prior_d", "<f8", (n,)),
        ("pass_J", "<f8", (n, n)),
        ("once", "<f8", (n, n)),
    )
    return record(*fields, *kept, *own)
