"""Two oracles of the smoother that share no line with it: one conditioned Gaussian, and the recursion as printed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import expm

from fusiond.assembly.assembly import Assembly
from fusiond.assembly.trial import Trial
from fusiond.engine.records import HAS_R
from fusiond.types import RESET, Hold, Role


@dataclass
class Linear:
    """A linear model in continuous time, as matrices: x' = A x + B u + G w."""

    A: Any
    B: Any
    Q: Any  # (n, n) density of G w

    def over(self, dt_s: float) -> tuple[Any, Any, Any]:
        """F, B and Q of one interval, by Van Loan's block exponential."""
        n, m = self.B.shape
        top = expm(np.block([[-self.A, self.Q], [np.zeros((n, n)), self.A.T]]) * dt_s)
        F = top[n:, n:].T
        held = expm(np.block([[self.A, self.B], [np.zeros((m, n + m))]]) * dt_s)[:n, n:]
        return F, held, F @ top[:n, n:]


@dataclass
class Seen:
    """One reading for the batch: at `t_ns`, either an input's values or z = H x + v."""

    t_ns: int
    H: Any
    z: Any
    R: Any


def batch(model: Linear, x0: Any, P0: Any, u_var: float, seen: list[Seen]) -> tuple[Any, Any]:
    """Mean (k, n) and covariance (k, n, n) of the state at every update given all: one Gaussian, conditioned once.

    The unknowns are the start and the disturbance of each interval, so that nothing here is inverted but the covariance
    of what was measured. seen: in the order of time; H None: an input.
    """
    n = len(x0)
    intervals = len(seen)
    S = np.zeros((n * (intervals + 1), n * (intervals + 1)))  # covariance of all unknowns
    S[:n, :n] = P0
    mean, M = np.array(x0), np.zeros((n, len(S)))
    M[:, :n] = np.eye(n)
    u, var, t_ns = np.zeros(model.B.shape[1]), 0.0, seen[0].t_ns
    at, rows, offsets, R = [], [], [], []
    for k, reading in enumerate(seen):
        F, held, Q = model.over((reading.t_ns - t_ns) * 1e-9)
        t_ns = reading.t_ns
        mean, M = F @ mean + held @ u, F @ M
        place = slice(n * (k + 1), n * (k + 2))
        M[:, place] = np.eye(n)
        S[place, place] = Q + var * held @ held.T
        if reading.H is None:
            u, var = reading.z, u_var
            continue
        at.append((mean, M.copy()))
        rows.append(reading.H @ M)
        offsets.append(reading.z - reading.H @ mean)
        R.append(reading.R)
    A, nu, noise = np.vstack(rows), np.concatenate(offsets), np.zeros((0, 0))
    for part in R:
        noise = np.block(
            [[noise, np.zeros((len(noise), len(part)))], [np.zeros((len(part), len(noise))), part]]
        )
    gain = np.linalg.solve(A @ S @ A.T + noise, A @ S).T
    theta, left = gain @ nu, S - gain @ A @ S
    x = np.array([m + M @ theta for m, M in at])
    return x, np.array([M @ left @ M.T for _, M in at])


def rts(assembly: Assembly, readings: Any) -> tuple[Any, Any]:
    """The smoother of Rauch, Tung and Striebel as printed, with inverses of P-, in plain numpy.

    Args:
        readings: in the order of time, all of them accepted, none later than `max_step_s` after the one before.
    Returns:
        x (k, states) and P (k, n, n) after every update.
    """
    trial, resolved = Trial(assembly.resolved), assembly.resolved
    x, P = trial.initial(), np.diag([float(v) ** 2 for v in _stds(assembly)])
    u, u_var = np.zeros(len(resolved.process.inputs)), np.zeros(len(resolved.process.inputs))
    t_ns, F_all, steps = int(readings["t_ns"][0]), np.eye(len(P)), []
    for reading in readings:
        sensor = resolved.sensors[int(reading["sensor"])]
        held_first = sensor.role is Role.INPUT and sensor.hold is Hold.PREVIOUS
        if held_first:
            u[list(sensor.drives)], u_var[list(sensor.drives)] = (
                reading["z"][: len(sensor.drives)],
                np.diag(sensor.R),
            )
        dt_s = (int(reading["t_ns"]) - t_ns) * 1e-9
        t_ns = int(reading["t_ns"])
        if dt_s > 0.0:
            Q = _process_noise(trial, x, u_var, u, dt_s)
            x, F, _ = trial.move(x, u, dt_s)
            P, F_all = F @ P @ F.T + Q, F @ F_all
        if sensor.role is Role.INPUT:
            if not held_first:
                u[list(sensor.drives)] = reading["z"][: len(sensor.drives)]
                u_var[list(sensor.drives)] = np.diag(sensor.R)
            continue
        x_before, P_before = x, P
        h, H = _look(trial, sensor, x, reading["z"])
        nu = reading["z"][: len(h)] - h
        nu = np.where(_wraps(sensor), (nu + np.pi) % (2 * np.pi) - np.pi, nu)
        R = reading["R"][: len(h), : len(h)] if int(reading["flags"]) & HAS_R else sensor.R
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
        x = trial.shift(x, K @ nu)
        kept = np.eye(len(P)) - K @ H
        P = kept @ P @ kept.T + K @ R @ K.T
        steps.append((F_all, x_before, P_before, x, P))
        F_all = np.eye(len(P))
    return _walk_back(trial, steps)


def _walk_back(trial: Trial, steps: list[Any]) -> tuple[Any, Any]:
    xs, Ps = [steps[-1][3]], [steps[-1][4]]
    for (_, _, _, x, P), (F, x_before, P_before, _, _) in zip(steps[-2::-1], steps[:0:-1], strict=True):
        A = P @ F.T @ np.linalg.inv(P_before)
        xs.append(trial.shift(x, A @ trial.error(x_before, xs[-1])))
        Ps.append(P + A @ (Ps[-1] - P_before) @ A.T)
    return np.array(xs[::-1]), np.array(Ps[::-1])


def _stds(assembly: Assembly) -> Any:
    d = assembly.design[0]["d0"]
    U = np.triu(assembly.design[0]["U0"], 1) + np.eye(len(d))
    assert np.array_equal(U, np.eye(len(d)))
    return np.sqrt(d)


def _process_noise(trial: Trial, x: Any, u_var: Any, u: Any, dt_s: float) -> Any:
    from fusiond.numerics.kernel import interpreted

    module, process = trial.resolved.process_module, trial.resolved.process
    n, k = len(process.error_slots), max(process.noises, 1)
    G, q = np.zeros((n, k)), np.zeros(k)
    interpreted(module.noise)(x, dt_s, trial.parameters(), G, q)
    B = trial.move(x, u, dt_s)[2]
    return (G * q) @ G.T + (B * u_var) @ B.T


def _look(trial: Trial, sensor: Any, x: Any, z: Any) -> tuple[Any, Any]:
    turn = 0
    if sensor.model.indices:
        turn = list(sensor.model.indices).index(z[sensor.model.dof])
    return trial.look(sensor, x, turn)


def _wraps(sensor: Any) -> Any:
    return np.array([slot.name in sensor.model.wraps for slot in sensor.model.channels[: sensor.model.dof]])


def reset(layout: Any, t_ns: int) -> Any:
    """One reset, (1,)."""
    record = np.zeros(1, layout.reading)
    record["t_ns"], record["sensor"] = t_ns, RESET
    return record
