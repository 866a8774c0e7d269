"""Linear-quadratic-Gaussian control: the regulator of `lqr` fed with the estimate, its command late by a known delay.

Commands that have not acted yet are states of the plant (`fusiond.control.plant`), so u = us - K (x - xs) - Kq (queue -
us) acts on what the state will be when the command gets there. What it costs on average is known beforehand, for every
set of working sensors (`fusiond.control.cost`).

The plant is the process model, where the controls are inputs of it: the command then drives the prediction, as long as
nobody acknowledges on `applied` what the actuator really did. Or it is given as x' = A x + B u, its states among the
filter's: a car whose prediction is driven by a measured acceleration is pushed by a force that the filter never sees.

Source: Astrom and Wittenmark, Computer-Controlled Systems, section 11.4; seed 004 names LQG and gives no numbers.
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
    delay_s: float = 0.0,
) -> Law:
    """Describe the law.

    Args:
        controls: names of the commands: inputs of the process model, or of the plant given as A and B.
        state_cost, input_cost: weights by name, or a whole matrix; of a continuous plant, per second.
        tracks: states that follow `reference`; none: the state is brought to zero, and no reference is needed.
        states: the plant's states, among the filter's, in the order of A; by default all but the disturbances.
        A, B: the plant, where it is not the process model: x' = A x + B u + w.   W: spectral density of w.
        units: of the controls of such a plant, as `["n"]`.
        around: values of inputs, by name with unit, that a nonlinear process model is linearised at.
        disturbances: states that nothing controls and that the command makes up for: offset-free tracking.
        feedforward: the command that holds the plant still, as a weight.
        delay_s: from the command until it acts; whole periods where the command drives the prediction.
    """
    wish = Wish(
        controls,
        state_cost,
        input_cost,
        tracks,
        states,
        A,
        B,
        W,
        units,
        around,
        disturbances,
        feedforward,
        delay_s,
    )
    return law_of(process, *plan_of(process, setting, wish))
