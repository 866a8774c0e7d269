"""A model's Jacobians against differences of its own functions: a wrong one is found at start-up, not in the field."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fusiond.assembly.observability import trial_interval_s
from fusiond.assembly.resolve import Resolved
from fusiond.assembly.trial import Array, Trial, irregular
from fusiond.errors import ConfigError
from fusiond.numerics.discretise import wrap_angle
from fusiond.numerics.kernel import interpreted

STEP = 1e-6
TOLERANCE = 1e-5


def numerical_jacobian(function: Callable[[Array], Array], at: Array, wraps: Array) -> Array:
    """Central differences of a vector function; rows flagged in `wraps` are differenced on the circle."""
    columns = []
    for j in range(len(at)):
        step = STEP * max(1.0, abs(at[j]))
        ahead, behind = at.copy(), at.copy()
        ahead[j] += step
        behind[j] -= step
        difference = function(ahead) - function(behind)
        wrapped = np.array([interpreted(wrap_angle)(value) for value in difference])
        columns.append(np.where(wraps, wrapped, difference) / (2.0 * step))
    return np.column_stack(columns) if columns else np.zeros((len(wraps), 0))


def _compare(subject: str, what: str, written: Array, measured: Array) -> None:
    """Raise ConfigError naming the first element that is wrong."""
    wrong = np.abs(written - measured) > TOLERANCE * (1.0 + np.abs(measured))
    for i, j in np.argwhere(wrong):
        raise ConfigError(
            f"{subject}: {what}[{i}, {j}] is {written[i, j]:.6g}, its own function says {measured[i, j]:.6g}; "
            f"correct the Jacobian"
        )


def check_jacobians(resolved: Resolved) -> None:
    """Check F and B of a nonlinear process model and H of every sensor model; raises ConfigError."""
    trial, process = Trial(resolved), resolved.process
    x, dt_s = trial.start(), trial_interval_s(resolved)
    u = irregular(len(process.inputs), 3)
    if not process.linear:
        angles = np.array([slot.name in process.angles for slot in process.states])
        _, F, B = trial.move(x, u, dt_s)
        by_state = numerical_jacobian(lambda at: trial.move(at, u, dt_s)[0], x, angles)
        by_input = numerical_jacobian(lambda at: trial.move(x, at, dt_s)[0], u, angles)
        _compare("model", "F", F, by_state)
        _compare("model", "B", B, by_input)
    for sensor in resolved.updating:
        model = sensor.model
        wraps = np.array([slot.name in model.wraps for slot in model.channels[: model.dof]])
        H = trial.look(sensor, x)[1]
        measured = numerical_jacobian(lambda at, sensor=sensor: trial.look(sensor, at)[0], x, wraps)  # type: ignore[misc]
        _compare(f"sensor.{sensor.name}", "H", H, measured)
