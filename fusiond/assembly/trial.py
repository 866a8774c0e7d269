"""The models of a configuration, called as plain Python at design time: no compiling, one state at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.resolve import Resolved, ResolvedSensor, by_key
from fusiond.errors import ConfigError
from fusiond.numerics.kernel import interpreted

Array = NDArray[np.float64]


def irregular(count: int, seed: int = 0) -> Array:
    """Numbers between 0.5 and 1.5 with no pattern a model could mistake for structure (golden-ratio sequence)."""
    places = np.arange(1, count + 1, dtype=np.float64) + 7.0 * seed
    return np.asarray(0.5 + places * 0.6180339887498949 % 1.0, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Trial:
    """Plain calls of one configuration's models."""

    resolved: Resolved

    def parameters(self) -> Array:
        """The process model's parameter vector."""
        return np.array(self.resolved.process.parameters or (0.0,), dtype=np.float64)

    def shift(self, x: Array, dx: Array) -> Array:
        """x [+] dx."""
        if not self.resolved.process.errors:
            return x + dx
        moved = x.copy()
        interpreted(self.resolved.process_module.add_error)(moved, dx, self.parameters())
        return moved

    def error(self, x: Array, y: Array) -> Array:
        """dx with x [+] dx = y; angles on the circle."""
        process = self.resolved.process
        if process.errors:
            dx = np.zeros(len(process.errors))
            interpreted(self.resolved.process_module.error_between)(x, y, self.parameters(), dx)
            return dx
        circular = np.array([slot.name in process.angles for slot in process.states])
        difference = y - x
        wrapped = (difference + np.pi) % (2.0 * np.pi) - np.pi
        return np.asarray(np.where(circular, wrapped, difference), dtype=np.float64)

    def move(self, x: Array, u: Array, dt_s: float) -> tuple[Array, Array, Array]:
        """x_next (n,), F (n, n), B (n, inputs) of one interval, s."""
        process, module = self.resolved.process, self.resolved.process_module
        n, m = len(process.error_slots), len(process.inputs)
        p = self.parameters()
        F, B = np.zeros((n, n)), np.zeros((n, max(m, 1)))
        if process.linear:
            c, G, q = np.zeros(n), np.zeros((n, max(process.noises, 1))), np.zeros(max(process.noises, 1))
            interpreted(module.discretise)(dt_s, p, F, B, c, G, q)
            return F @ x + B[:, :m] @ u + c, F, B[:, :m]
        x_next = np.zeros(len(process.states))
        interpreted(module.transition)(x, u, dt_s, p, x_next, F, B)
        return x_next, F, B[:, :m]

    def disturbance(self, x: Array, dt_s: float) -> Array:
        """Q (n, n) of one interval, s, that of noisy inputs included."""
        process, module = self.resolved.process, self.resolved.process_module
        n, k, m = len(process.states), max(process.noises, 1), len(process.inputs)
        p, G, q, B = (
            np.array(process.parameters or (0.0,)),
            np.zeros((n, k)),
            np.zeros(k),
            np.zeros((n, max(m, 1))),
        )
        if process.linear:
            interpreted(module.discretise)(dt_s, p, np.zeros((n, n)), B, np.zeros(n), G, q)
        else:
            interpreted(module.noise)(x, dt_s, p, G, q)
            B[:, :m] = self.move(x, np.zeros(m), dt_s)[2]
        held = np.zeros(max(m, 1))
        for sensor in self.resolved.sensors:
            held[list(sensor.drives)] = np.diagonal(sensor.R)[: len(sensor.drives)]
        return np.asarray((G * q) @ G.T + (B * held) @ B.T)

    def look(self, sensor: ResolvedSensor, x: Array, turn: int = 0) -> tuple[Array, Array]:
        """h (dof,) and H (dof, n) of an updating sensor; `turn` chooses among the indices it may carry."""
        model = sensor.model
        places = {slot.name: place for place, slot in enumerate(self.resolved.process.states)}
        at = np.array([places[name] for name in model.reads], dtype=np.int64)
        z = np.zeros(len(model.channels))
        if model.indices:
            z[model.dof :] = model.indices[turn % len(model.indices)]
        h, H = np.zeros(len(z)), np.zeros((len(z), len(self.resolved.process.error_slots)))
        assert sensor.module is not None
        observe: Callable[..., bool] = interpreted(sensor.module.observe)
        observe(x, z, at, np.array(model.parameters or (0.0,)), h, H)
        return h[: model.dof], H[: model.dof]

    def initial(self) -> Array:
        """The configured initial state, its quaternion of unit length; raises ConfigError."""
        process = self.resolved.process
        values = by_key(self.resolved.config.initial.state, process.states, "initial.state")
        origin = process.origin or (0.0,) * len(process.states)
        x0 = np.array(
            [values.get(slot.name, value) for slot, value in zip(process.states, origin, strict=True)]
        )
        state = self.shift(x0, np.zeros(len(process.error_slots)))
        if not np.isfinite(state).all():
            raise ConfigError(
                "initial.state: a quaternion of length zero is no attitude; leave it out for the default"
            )
        return state

    def start(self) -> Array:
        """The initial state moved off every special value, so that nothing is zero by accident."""
        return self.shift(self.initial(), irregular(len(self.resolved.process.error_slots)))
