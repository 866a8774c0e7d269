"""Protection levels of every report (`fusiond.faults.protection`). `assembly` copies this over `protect.py`.

A filter that leaves a sensor out has its own, older time: it is carried to that of the primary filter, compared, and
put back as it was, so that nothing in the track depends on whether levels are asked for. The filter without an excluded
sensor is the primary filter, or, where that sensor was heard before, a witness like the others: it counts too.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.engine.records import CENTRAL
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import ud_variance

from .inject import between
from .predict import predict
from .sizes import FILTERS, PROTECTED
from .update import keep, put_back


@kernel
def reach(track: Any, design: Any, row: int, slot: int) -> float:
    """Error of filter `row` that is exceeded with the promised probability, when it heard no lie; unit of the slot."""
    level = design.quantile * np.sqrt(ud_variance(track.U[row], track.d[row], slot))
    return level if np.isfinite(level) else np.inf


@kernel
def widen(track: Any, design: Any, work: Any, row: int, report: Any) -> None:
    """Raise report.protection to cover a lie of the sensor that filter `row` never heard, both at one time."""
    between(track.x[row], track.x[CENTRAL], work.dx, design)
    for k in range(PROTECTED):
        slot = design.protected[k]
        level = abs(work.dx[slot]) + reach(track, design, row, slot)
        if not level <= report.protection[k]:
            report.protection[k] = level if np.isfinite(level) else np.inf


@kernel
def protect(track: Any, design: Any, work: Any, report: Any) -> None:
    """Write report.protection: max(K sigma, max_i(|x - x_-i| + K sigma_-i)); infinite before the first reading."""
    for k in range(PROTECTED):
        report.protection[k] = np.inf
    if not track.started:
        return
    for k in range(PROTECTED):
        report.protection[k] = reach(track, design, CENTRAL, design.protected[k])
    t_ns = track.filter_t_ns[CENTRAL]
    for row in range(1, FILTERS):
        if not design.spares[row]:
            continue
        own_ns = track.filter_t_ns[row]
        if own_ns >= t_ns:
            widen(track, design, work, row, report)
            continue
        keep(track, work, row)
        predict(track, design, work, row, t_ns)
        widen(track, design, work, row, report)
        put_back(track, work, row)
        track.filter_t_ns[row] = own_ns
