"""Reports as the JSON messages people read: what a recording made by `replay` has on its `estimate` channel."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.recording.reading_json import number_json
from fusiond.types import NANOSECONDS, ServiceHealth, seconds


def estimate_message(layout: Layout, report: Any, seq: int, epoch: str) -> dict[str, Any]:
    """The estimate after one report: `{t, seq, epoch, resets, jump{}, state{}, std{}, health, unobserved[]}`, and
    `protection{}` where it was asked for.
    """
    names, errors = [slot.name for slot in layout.states], [slot.name for slot in layout.errors]
    resets = int(report["resets"])
    return {
        "t": seconds(int(report["state_t_ns"])),
        "seq": seq,
        "epoch": epoch,
        "resets": resets,
        "jump": dict(zip(errors, map(number_json, report["jump"]), strict=False)) if resets else {},
        "state": dict(zip(names, map(number_json, report["x"]), strict=False)),
        "std": dict(zip(errors, map(number_json, report["std"]), strict=False)),
        "health": ServiceHealth(int(report["service"])).label,
        "unobserved": layout.named(int(report["unobserved"])),
    } | protection_part(layout, report)


def protection_part(layout: Layout, report: Any) -> dict[str, dict[str, float | None]]:
    """`{protection: {name: level}}`, null where nothing limits the error; empty where no level was asked for."""
    if not layout.protected:
        return {}
    levels = [level if math.isfinite(level) else None for level in report["protection"].tolist()]
    return {"protection": dict(zip([slot.name for slot in layout.protected], levels, strict=True))}


class Thinning:
    """Picks at most `rate_hz` reports a second of state time, the first of each interval."""

    def __init__(self, rate_hz: float) -> None:
        self._period_ns = max(1, round(NANOSECONDS / rate_hz))
        self._interval: int | None = None

    def pick(self, reports: NDArray[Any]) -> Iterator[Any]:
        """The reports to show, in order."""
        interval = reports["state_t_ns"] // self._period_ns
        before = np.concatenate(
            [[interval[0] - 1 if self._interval is None else self._interval], interval[:-1]]
        )
        self._interval = int(interval[-1])
        for row in np.flatnonzero(interval != before):
            yield reports[row]
