"""A model's Jacobians against differences of its own functions: a wrong one is found at start-up, not in the field."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fusiond.assembly.observability import trial_interval_s
from fusiond.assembly.resolve import Resolved, ResolvedSensor
from fusiond.assembly.trial import Array, Trial, irregular
from fusiond.errors import ConfigError

STEP = 1e-6
TOLERANCE = 1e-5
ROUNDING = 1e-9
"""Of a row's largest element, which drowns the differences of its smallest: states may be in nanometres."""


def numerical_jacobian(difference: Callable[[Array, Array], Array], dimensions: int, scale: Array) -> Array:
    """Central differences of a function near one point.

    Args:
        difference: value at the point moved by its first argument, less that at the point moved by its second.
        dimensions: of the move.   scale: (dimensions,) sizes of the numbers moved; steps are relative to them.
    """
    columns = []
    for j in range(dimensions):
        step = np.zeros(dimensions)
        step[j] = STEP * max(1.0, abs(scale[j]))
        columns.append(difference(step, -step) / (2.0 * step[j]))
    return np.column_stack(columns) if columns else np.zeros((0, 0))


def _compare(subject: str, what: str, written: Array, measured: Array) -> None:
    """Raise ConfigError naming the first element that is wrong."""
    rounding = ROUNDING * np.max(np.abs(measured), axis=1, keepdims=True, initial=0.0)
    wrong = np.abs(written - measured) > TOLERANCE * (1.0 + np.abs(measured)) + rounding
    for i, j in np.argwhere(wrong):
        raise ConfigError(
            f"{subject}: {what}[{i}, {j}] is {written[i, j]:.6g}, its own function says {measured[i, j]:.6g}; "
            f"correct the Jacobian"
        )


def check_process(resolved: Resolved) -> None:
    """Check F and B of a nonlinear process model; raises ConfigError."""
    trial, process = Trial(resolved), resolved.process
    x, dt_s = trial.start(), trial_interval_s(resolved)
    u = irregular(len(process.inputs), 3)
    n = len(process.error_slots)

    def by_state(ahead: Array, behind: Array) -> Array:
        return trial.error(
            trial.move(trial.shift(x, behind), u, dt_s)[0], trial.move(trial.shift(x, ahead), u, dt_s)[0]
        )

    def by_input(ahead: Array, behind: Array) -> Array:
        return trial.error(trial.move(x, u + behind, dt_s)[0], trial.move(x, u + ahead, dt_s)[0])

    _, F, B = trial.move(x, u, dt_s)
    _compare("model", "F", F, numerical_jacobian(by_state, n, x))
    if len(u):
        _compare("model", "B", B, numerical_jacobian(by_input, len(u), u))


def check_sensor(resolved: Resolved, sensor: ResolvedSensor) -> None:
    """Check H of one sensor model; raises ConfigError."""
    trial, model = Trial(resolved), sensor.model
    x = trial.start()
    wraps = np.array([slot.name in model.wraps for slot in model.channels[: model.dof]])

    def by_state(ahead: Array, behind: Array) -> Array:
        change = trial.look(sensor, trial.shift(x, ahead))[0] - trial.look(sensor, trial.shift(x, behind))[0]
        wrapped = (change + np.pi) % (2.0 * np.pi) - np.pi
        return np.asarray(np.where(wraps, wrapped, change), dtype=np.float64)

    measured = numerical_jacobian(by_state, len(resolved.process.error_slots), x)
    _compare(f"sensor.{sensor.name}", "H", trial.look(sensor, x)[1], measured)


def check_jacobians(resolved: Resolved) -> None:
    """Check the Jacobians of a nonlinear process model and of every sensor model; raises ConfigError."""
    if not resolved.process.linear:
        check_process(resolved)
    for sensor in resolved.updating:
        check_sensor(resolved, sensor)
