"""The settled covariance of a linear, time-invariant configuration, at any moment of the period of its slowest sensor.

Exact for sensors that read at their rates, the first of all at one moment: inputs are held for a period of their own,
each with a noise of its own (`assembly.course`, made for telling faults apart, takes one noise for all between two
updates).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusiond.assembly.course import rate_hz, slowest_period_s
from fusiond.assembly.motion import motion_of
from fusiond.assembly.resolve import Resolved
from fusiond.assembly.trial import Trial
from fusiond.numerics.riccati import Matrix, symmetric
from fusiond.types import Role

DOUBLINGS = 48
"""Periods of the slowest sensor until it has settled, as a power of two."""
SETTLED = 1e-13
NOISELESS = 1e-12
"""Noise taken for a reading that has none, relative to what is predicted for it."""


@dataclass(frozen=True, slots=True)
class Event:
    """A reading of an updating sensor: its time in the period, s, its number, H and R."""

    t_s: float
    sensor: int
    H: Matrix
    R: Matrix


def events_of(resolved: Resolved) -> tuple[list[Event], float]:
    """The readings of one period of the slowest sensor, and how long that is, s; none: one step of the command."""
    section = resolved.config.control
    if not resolved.updating:
        return [], 1.0 / section.rate_hz if section else 1.0
    period_s, trial = slowest_period_s(resolved), Trial(resolved)
    events = []
    for number, sensor in enumerate(resolved.sensors):
        if sensor.role is Role.UPDATE:
            count = max(1, round(rate_hz(resolved, sensor) * period_s))
            H = trial.look(sensor, trial.start())[1]
            events += [Event(place * period_s / count, number, H, sensor.R) for place in range(count)]
    events.sort(key=lambda event: (round(event.t_s, 9), event.sensor))
    return events, period_s


class Mover:
    """Predictions of one configuration, remembered by their length."""

    def __init__(self, resolved: Resolved) -> None:
        self._resolved = resolved
        self._known: dict[int, tuple[Matrix, Matrix]] = {}
        rates = [rate_hz(resolved, s) for s in resolved.sensors if s.role is Role.INPUT and np.any(s.R)]
        self._input_s = 1.0 / max(rates) if rates else 0.0
        self._held = np.zeros(len(resolved.process.inputs))
        for sensor in resolved.sensors:
            self._held[list(sensor.drives)] = np.diagonal(sensor.R)[: len(sensor.drives)]

    def over(self, dt_s: float) -> tuple[Matrix, Matrix]:
        """F and Q of dt_s, noise of the inputs included."""
        key = round(dt_s * 1e9)
        if key not in self._known:
            self._known[key] = self._over(dt_s)
        return self._known[key]

    def _over(self, dt_s: float) -> tuple[Matrix, Matrix]:
        n = len(self._resolved.process.states)
        if dt_s <= 1e-9:
            return np.eye(n), np.zeros((n, n))
        pieces = max(1, round(dt_s / self._input_s)) if self._input_s else 1
        motion = motion_of(self._resolved.process, self._resolved.process_module, dt_s / pieces, {})
        step = motion.F, motion.W + (motion.B * self._held) @ motion.B.T
        return _repeated(step, pieces)


def _repeated(step: tuple[Matrix, Matrix], times: int) -> tuple[Matrix, Matrix]:
    """F and Q of so many equal steps."""
    F, Q = np.eye(len(step[0])), np.zeros_like(step[0])
    while times:
        if times & 1:
            F, Q = step[0] @ F, step[0] @ Q @ step[0].T + step[1]
        step = step[0] @ step[0], step[0] @ step[1] @ step[0].T + step[1]
        times >>= 1
    return F, Q


def corrected(P: Matrix, event: Event) -> Matrix:
    """P after a reading."""
    S = event.H @ P @ event.H.T + event.R
    gain = np.linalg.solve(S + NOISELESS * np.diag(np.diag(S)), event.H @ P).T
    return symmetric(P - gain @ S @ gain.T)


def settled_at_begin(events: list[Event], period_s: float, mover: Mover, n: int) -> Matrix | None:
    """P (n, n) before the first reading of a period, settled; None where it grows without end.

    One period maps P to C + A P (I + G P)^-1 A', and so do two (structure-preserving doubling).
    Source: Anderson 1978, "Second-order convergent algorithms for the steady-state Riccati equation".
    """
    eye = np.eye(n)
    A, G, C = eye, np.zeros((n, n)), np.zeros((n, n))
    times = [*(event.t_s for event in events), period_s]
    before_s = times[0] if events else 0.0
    for place, t_s in enumerate(times):
        F, Q = mover.over(t_s - before_s)
        A, C, before_s = F @ A, F @ C @ F.T + Q, t_s
        if place < len(events):
            event = events[place]
            spread = np.diag(np.diag(event.H @ C @ event.H.T)) + 1e-30 * np.eye(len(event.R))
            information = event.H.T @ np.linalg.solve(event.R + NOISELESS * spread, event.H)
            W = np.linalg.solve(eye + C @ information, eye)
            G = symmetric(G + A.T @ information @ W @ A)
            A, C = W @ A, symmetric(W @ C)
    F, Q = mover.over(times[0])
    A, C = F @ A, symmetric(F @ C @ F.T + Q)
    for _ in range(DOUBLINGS):
        W = np.linalg.solve(eye + C @ G, eye)
        more = A @ W @ C @ A.T
        A, G, C = A @ W @ A, symmetric(G + A.T @ G @ W @ A), symmetric(C + more)
        if not np.isfinite(C).all():
            return None
        if np.abs(more).max() <= SETTLED * np.abs(C).max():
            return C
    return None
