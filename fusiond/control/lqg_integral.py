"""LQG with integral action: what is tracked also follows a plant that is not quite the model's.

    u = us - K (z - zs) - L q,    q+ = q + period (C x - reference) + Y (done - wanted)

K and L minimise the cost of `lqg` plus integral_cost times the integrals squared. The last term unwinds: where the
command was limited, or the actuator says that it did otherwise, the integrals give back a share of what was lacking
(back-calculation; Astrom and Hagglund, Advanced PID Control, section 3.5). The integral acts on the estimate: a
disturbance that the filter explains away, and a sensor that lies, it cannot see. A disturbance that is a state of the
process model is better named in `disturbances`.
"""

from __future__ import annotations

from typing import Any

from fusiond.control.contract import Law, Setting
from fusiond.control.designing import Rows, Weight, Wish, law_of, plan_of
from fusiond.control.feedback import feed_back, integrate, take_off_integrals
from fusiond.control.feedback import quadratic as cost
from fusiond.errors import ConfigError
from fusiond.models.contract import Process
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Vector

__all__ = ["command", "cost", "describe"]


def describe(
    process: Process,
    setting: Setting,
    *,
    controls: list[str],
    state_cost: Weight,
    input_cost: Weight,
    tracks: list[str],
    integral_cost: dict[str, float],
    states: list[str] | None = None,
    A: Rows | None = None,
    B: Rows | None = None,
    W: Rows | None = None,
    units: list[str] | None = None,
    around: dict[str, float] = {},  # noqa: B006 (a default of a setting, never changed)
    disturbances: list[str] = [],  # noqa: B006
    feedforward: list[float] | None = None,
    delay_s: float = 0.0,
    unwinding_s: float = 0.3,
) -> Law:
    """Describe the law.

    Args:
        controls, state_cost, input_cost, tracks, states, A, B, W, units, around, disturbances, feedforward, delay_s: as
            of `lqg`.
        integral_cost: weight of the integral of each tracked state, per second.
        unwinding_s: time in which the integrals give back what a limit took from the command (the tracking time).
    """
    wish = Wish(
        controls, state_cost, input_cost, tracks, states, A, B, W, units, around, disturbances, feedforward, delay_s,
        integral_cost,
    )  # fmt: skip
    if unwinding_s <= 0.0:
        raise ConfigError("unwinding_s: is not above 0; give the time in which the integrals unwind")
    share = min(1.0, setting.period_s / unwinding_s)
    return law_of(process, *plan_of(process, setting, wish), unwinding=share)


@kernel
def command(x: Vector, desk: Any, at: Vector, c: Vector, u: Vector) -> None:
    """Bring the integrals to now, and write the command; u may be desk.wanted, which the integrals read first."""
    integrate(x, desk, at, c)
    feed_back(x, desk, at, c, u)
    take_off_integrals(desk, c, u)
