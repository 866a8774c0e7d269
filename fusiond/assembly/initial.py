"""The covariance before the first reading, as a configuration says it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.resolve import Resolved, by_key, require_all
from fusiond.errors import ConfigError
from fusiond.numerics.covariance import examine


def initial_covariance(resolved: Resolved) -> NDArray[np.float64]:
    """P of the errors in the model's order, (n, n); raises ConfigError where it is incomplete or none."""
    initial, slots = resolved.config.initial, resolved.process.error_slots
    if initial.covariance is None:
        stds = by_key(initial.std, slots, "initial.std")
        require_all(stds, slots, "initial.std", "say how well each is known at the start")
        return np.diag([float(stds[slot.name]) ** 2 for slot in slots])
    if initial.std:
        raise ConfigError("initial: has std and covariance; keep one of them")
    n, rows = len(slots), initial.covariance
    if {len(row) for row in rows} != {n} or len(rows) != n:
        raise ConfigError(f"initial.covariance: is not {n} x {n}; one row and one column a state")
    P = np.array(rows, dtype=float)
    if not examine(P).sound(regular=False):
        raise ConfigError(
            "initial.covariance: is not symmetric and positive semi-definite; check its numbers, or give std"
        )
    return P
