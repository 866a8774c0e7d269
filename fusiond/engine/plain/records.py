"""The records of a plain step: whole covariances P where the compiled one has the factors U and d."""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.adapt.records import noise_dtype
from fusiond.engine.records import Shape, design_dtype, record
from fusiond.faults.records import reaction_dtype

DRAWS = 64
"""Rows of the table of random diagonals; repairs take them in turn."""


def plain_track_dtype(shape: Shape) -> np.dtype[Any]:
    """Everything the estimator remembers. Row 0 is the estimate; further rows are one sensor's own filter each.

    repairs, unsound: covariances repaired, and those a repair left unsound; repair_size, repair_last: the largest and
    the last change, in the repaired standard deviations; condition: the largest condition number met. drawn: next row
    of design.draws.
    batch_*: the readings of one stamp and the estimate before them (topologies that fuse them together).
    honest: true covariance of an update that misreports its own (seed_averaged).
    noise: adapt.records, where noise is estimated.
    """
    n, f, s, m, ni = shape.states, shape.filters, shape.sensors, shape.payload, shape.inputs
    return record(
        ("started", "<i8"), ("t_ns", "<i8"), ("start_ns", "<i8"), ("update_ns", "<i8"), ("resets", "<i8"),
        ("jump", "<f8", (n,)),
        ("filter_t_ns", "<i8", (f,)), ("x", "<f8", (f, n)), ("P", "<f8", (f, n, n)),
        ("u", "<f8", (ni,)), ("u_var", "<f8", (ni,)),
        ("gap_from_ns", "<i8", (s,)), ("gap_to_ns", "<i8", (s,)),
        ("gaps", "<i8", (s,)), ("late_gaps", "<i8", (s,)), ("late_share", "<f8", (s,)), ("late_excess_ns", "<f8", (s,)),
        ("live", "<i8", (s,)),
        ("sensor_seen", "<i8", (s,)), ("sensor_t_ns", "<i8", (s,)), ("sensor_z", "<f8", (s, m)),
        ("repairs", "<i8"), ("unsound", "<i8"), ("repair_size", "<f8"), ("repair_last", "<f8"), ("condition", "<f8"),
        ("drawn", "<i8"),
        ("reaction", reaction_dtype(sensors=s, payload=m)),
        ("batch_size", "<i8"), ("batch_t_ns", "<i8"), ("batch_x", "<f8", (n,)), ("batch_P", "<f8", (n, n)),
        ("batch_honest", "<f8", (n, n)), ("batch_has", "<i8", (s,)), ("batch_nu", "<f8", (s, m)),
        ("batch_H", "<f8", (s, m, n)), ("batch_R", "<f8", (s, m, m)), ("honest", "<f8", (n, n)),
        *([("noise", noise_dtype(shape.adapt, sensors=s, payload=m))] if shape.adapt else []),
    )  # fmt: skip


def plain_design_dtype(shape: Shape) -> np.dtype[Any]:
    """The compiled step's tables and three more.

    local: (s,) row of each sensor's own filter, -1 none.   share: (f,) part of prior and process information that
    each row holds, 1 for a whole filter.   draws: (DRAWS, n) diagonals of the seed's repair, |o_ii|.
    """
    base: Any = design_dtype(shape)
    fields = [(name, base[name].base, base[name].shape) for name in base.names]
    return record(
        *fields,
        ("local", "<i8", (shape.sensors,)),
        ("share", "<f8", (shape.filters,)),
        ("draws", "<f8", (DRAWS, shape.states)),
    )
