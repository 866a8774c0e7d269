"""The proportional-derivative law of seed 000, equations 24 and 28, with the saturation its text mentions.

    u = feedforward + clip(kp (reference - position) - kv velocity, -limit, limit)

The feedforward is m g for a rotorcraft. The seed gives no value for the limit (its figure 3 is lost).
"""

from __future__ import annotations

from typing import Any

from fusiond.control.contract import Law, Setting
from fusiond.models.contract import Process
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import Vector
from fusiond.types import Slot


def describe(
    process: Process,
    setting: Setting,
    *,
    proportional_gain_n_m: float,
    derivative_gain_n_s_m: float,
    limit_n: float,
    feedforward_n: float = 0.0,
) -> Law:
    """Describe the law.

    Args:
        proportional_gain_n_m, derivative_gain_n_s_m: kp in N/m, kv in N s/m.
        limit_n: largest force on either side of the feedforward.   feedforward_n: force at rest.
    """
    return Law(
        controls=(Slot("force", "n"),),
        references=(process.slot("position"),),
        reads=(process.slot("position").name, process.slot("velocity").name),
        parameters=(proportional_gain_n_m, derivative_gain_n_s_m, limit_n, feedforward_n),
    )


@kernel
def command(x: Vector, desk: Any, at: Vector, c: Vector, u: Vector) -> None:
    """Write the force, N."""
    correction = c[0] * (desk.reference[0] - x[at[0]]) - c[1] * x[at[1]]
    u[0] = c[3] + min(max(correction, -c[2]), c[2])


@kernel
def cost(x: Vector, desk: Any, at: Vector, c: Vector) -> float:
    """Nothing says what this law should cost."""
    return 0.0
