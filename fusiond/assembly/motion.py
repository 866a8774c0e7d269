"""The process model over one control period, linearised, for laws that are designed from it."""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType

import numpy as np

from fusiond.control.contract import Motion, Setting
from fusiond.errors import ConfigError
from fusiond.models.contract import Process
from fusiond.numerics.kernel import interpreted
from fusiond.numerics.riccati import Matrix

PIECES = 1e-9


def setting_of(process: Process, module: ModuleType, rate_hz: float) -> Setting:
    """What a law of this process model, commanding so often, is told."""
    period_s = 1.0 / rate_hz

    def motion(around: Mapping[str, float]) -> Motion:
        """One period of the model."""
        return motion_of(process, module, period_s, around)

    return Setting(period_s, process.step_s > 0.0, motion)


def motion_of(process: Process, module: ModuleType, period_s: float, around: Mapping[str, float]) -> Motion:
    """F, B and W of one period where the inputs are as in `around`, by name with unit; raises ConfigError."""
    if process.errors:
        raise ConfigError("controls: the state of this model is no vector; give the plant as A and B")
    inputs = {slot.key: place for place, slot in enumerate(process.inputs)}
    u = np.zeros(len(inputs))
    for key, value in around.items():
        if key not in inputs:
            raise ConfigError(f"around: no input `{key}`; choose from {', '.join(inputs)}")
        u[inputs[key]] = value
    pieces, piece_s = 1, period_s
    if process.step_s > 0.0:
        pieces, piece_s = round(period_s / process.step_s), process.step_s
        if pieces < 1 or abs(pieces * piece_s - period_s) > PIECES * period_s:
            raise ConfigError(
                f"rate_hz: a period of {period_s:g} s is no multiple of the model's step of {piece_s:g} s; "
                "choose another"
            )
    elif process.max_step_s > 0.0:
        pieces = int(np.ceil(period_s / process.max_step_s - PIECES))
        piece_s = period_s / pieces
    n = len(process.states)
    F, B, W = np.eye(n), np.zeros((n, len(u))), np.zeros((n, n))
    for _ in range(pieces):
        f, b, w = _piece(process, module, piece_s, u)
        F, B, W = f @ F, f @ B + b, f @ W @ f.T + w
    return Motion(F, B, W)


def _piece(process: Process, module: ModuleType, dt_s: float, u: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """F, B and W of one prediction from the state zero."""
    n, m, k = len(process.states), max(len(process.inputs), 1), max(process.noises, 1)
    p = np.array(process.parameters or (0.0,), dtype=np.float64)
    F, B, G, q = np.zeros((n, n)), np.zeros((n, m)), np.zeros((n, k)), np.zeros(k)
    x = np.zeros(n)
    if process.linear:
        interpreted(module.discretise)(dt_s, p, F, B, np.zeros(n), G, q)
    else:
        interpreted(module.transition)(x, u, dt_s, p, np.zeros(n), F, B)
        interpreted(module.noise)(x, dt_s, p, G, q)
    return F, B[:, : len(process.inputs)], np.asarray((G * q) @ G.T)
