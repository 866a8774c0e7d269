"""The linear-quadratic regulator: u = us - K (x - xs), as if the estimate were the state and the command acted at once.

It minimises the mean of x' Q x + u' R u (continuous plants: its integral, sampled exactly). By separation it is also
the regulator of LQG: the estimate takes the place of the state, K is the same. `lqg` adds a delay, `lqg_integral`
integral action.

Source: Astrom and Wittenmark, Computer-Controlled Systems, sections 11.2 and 11.4.
"""

from __future__ import annotations

from fusiond.control.contract import Law, Setting
from fusiond.control.designing import Rows, Weight, Wish, law_of, plan_of
from fusiond.control.feedback import feed_back as command
from fusiond.control.feedback import quadratic as cost
from fusiond.models.contract import Process

__all__ = ["command", "cost", "describe"]


def describe(
    process: Process,
    setting: Setting,
    *,
    controls: list[str],
    state_cost: Weight,
    input_cost: Weight,
    tracks: list[str] = [],  # noqa: B006 (a default of a setting, never changed)
    states: list[str] | None = None,
    A: Rows | None = None,
    B: Rows | None = None,
    W: Rows | None = None,
    units: list[str] | None = None,
    around: dict[str, float] = {},  # noqa: B006
    disturbances: list[str] = [],  # noqa: B006
    feedforward: list[float] | None = None,
) -> Law:
    """Describe the law.

    Args:
        controls, state_cost, input_cost, tracks, states, A, B, W, units, around, disturbances, feedforward: as of
            `lqg`.
    """
    wish = Wish(
        controls, state_cost, input_cost, tracks, states, A, B, W, units, around, disturbances, feedforward
    )
    return law_of(process, *plan_of(process, setting, wish))
