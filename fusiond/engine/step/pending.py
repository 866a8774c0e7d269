"""The covariance of a filter is always that of its time: nothing is ever pending."""

from __future__ import annotations

from typing import Any

from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import thornton_predict, ud_compose


@kernel
def spread(track: Any, work: Any, row: int) -> None:
    """Predict U, d of filter `row` over the interval of work.F, W, w_d."""
    thornton_predict(track.U[row], track.d[row], work.F, work.W, work.w_d, work.a)


@kernel
def nothing_pending(track: Any, row: int) -> None:
    """Filter `row` begins."""


@kernel
def settle_pending(track: Any, work: Any, row: int) -> None:
    """Bring U, d of filter `row` to its time."""


@kernel
def settle_when_due(track: Any, design: Any, work: Any, row: int, before_ns: int) -> None:
    """Bring U, d of filter `row` to its time if that is due; it came from before_ns."""


@kernel
def keep_pending(track: Any, work: Any, row: int) -> None:
    """Copy aside what is pending."""


@kernel
def put_back_pending(track: Any, work: Any, row: int) -> None:
    """Undo what happened to it since."""


@kernel
def compose(track: Any, P: Any) -> None:
    """Write the covariance of the centralized filter at its time."""
    ud_compose(track.U[0], track.d[0], P)
