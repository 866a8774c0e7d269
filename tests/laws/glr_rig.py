"""Small Kalman filters in numpy that fill windows the way the step does; the laws of isolation share them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.faults.window import window_dtype

Matrix = NDArray[np.float64]
REFERENCE_A = np.array([[1.1269, -0.4940, 0.1129], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
REFERENCE_G = np.array([[-0.3832], [0.5919], [0.5191]])


@dataclass(frozen=True)
class Plant:
    """x+ = A x + B (u + f_input) + w, w ~ N(0, Q); every step each sensor i reads H[i] x + v, v ~ N(0, R[i])."""

    A: Matrix
    Q: Matrix
    H: tuple[Matrix, ...]
    R: tuple[Matrix, ...]
    B: Matrix = field(default_factory=lambda: np.zeros((1, 1)))
    dt_s: float = 1.0
    every: int = 1

    @property
    def n(self) -> int:
        return len(self.A)


def root_of(P: Matrix) -> Matrix:
    """A square root of a covariance, singular or not."""
    d, V = np.linalg.eigh(0.5 * (P + P.T))
    return V * np.sqrt(np.maximum(d, 0.0))


def reference(sensors: int = 2) -> Plant:
    """theory.md 1.1 with one or more equal sensors of its output."""
    C = np.array([[1.0, 0.0, 0.0]])
    return Plant(
        REFERENCE_A, 2.3 * REFERENCE_G @ REFERENCE_G.T, (C,) * sensors, (np.eye(1),) * sensors, REFERENCE_G
    )


def constant_velocity(sensors: int = 1) -> Plant:
    G = np.array([[0.005], [0.1]])
    A, C = np.array([[1.0, 0.1], [0.0, 1.0]]), np.array([[1.0, 0.0]])
    return Plant(A, G @ G.T, (C,) * sensors, (np.eye(1) * 0.01,) * sensors, G, 0.1)


def integrator(sensors: int, q: float = 1.0) -> Plant:
    one = np.eye(1)
    return Plant(one, q * one, (one,) * sensors, (one,) * sensors)


def minicar() -> Plant:
    """Position and velocity driven by a measured acceleration (1 kHz), position read every 30 ms; folded to 30 ms."""
    dt, every = 1e-3, 30
    a, b = np.array([[1.0, dt], [0.0, 1.0]]), np.array([[dt * dt / 2], [dt]])
    A, B, Q = np.eye(2), np.zeros((2, 1)), np.zeros((2, 2))
    for _ in range(every):
        A, B = a @ A, a @ B + b
        Q = a @ Q @ a.T + b @ b.T * 1e-4 + np.diag([0.0, 1e-6 * dt])
    return Plant(A, Q, (np.array([[1.0, 0.0]]),), (np.eye(1) * 1e-4,), B, dt * every)


Fault = Callable[[int, Matrix], Matrix]


class Run:
    """A filter run from its steady covariance, with faults, keeping its last W entries as a window."""

    def __init__(self, plant: Plant, seed: int, settle: int = 60) -> None:
        self.plant, self.rng = plant, np.random.default_rng(seed)
        n = plant.n
        self.x = np.zeros(n)
        self.P = self._steady(settle)
        self.xhat = self.x + root_of(self.P) @ self.rng.standard_normal(n)
        self.k = 0
        self.lines: list[Any] = []
        self.m = max(len(R) for R in plant.R)
        self.dtype = window_dtype(n, self.m, plant.B.shape[1])
        self.noise = root_of(plant.Q)

    def _steady(self, settle: int) -> Matrix:
        p = self.plant
        P = p.Q + np.eye(p.n) * 1e-2
        for _ in range(200 + settle):
            P = p.A @ P @ p.A.T + p.Q
            for H, R in zip(p.H, p.R, strict=True):
                K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
                P = (np.eye(p.n) - K @ H) @ P
        return 0.5 * (P + P.T)

    def step(
        self,
        fault: dict[int, Fault] | None = None,
        scale: dict[int, float] | None = None,
        input_fault: float = 0.0,
        u: float = 0.0,
    ) -> None:
        """One step; fault[i](k, h): error of sensor i where it should read h; scale[i]: factor of its noise."""
        p, fault, scale = self.plant, fault or {}, scale or {}
        drive = p.B[:, 0] if p.B.shape[0] == p.n else np.zeros(p.n)
        before = self.xhat
        self.x = p.A @ self.x + drive * u + self.noise @ self.rng.standard_normal(p.n)
        self.xhat = p.A @ self.xhat + drive * (u + input_fault)
        self.P = p.A @ self.P @ p.A.T + p.Q
        rate = (self.xhat - before) / p.dt_s
        for i, (H, R) in enumerate(zip(p.H, p.R, strict=True)):
            self._read(i, H, R, fault.get(i), scale.get(i, 1.0), first=i == 0, rate=rate)
        self.k += 1

    def _read(
        self, i: int, H: Matrix, R: Matrix, fault: Fault | None, factor: float, *, first: bool, rate: Matrix
    ) -> None:
        p = self.plant
        z = H @ self.x + factor * np.linalg.cholesky(R) @ self.rng.standard_normal(len(R))
        if fault is not None:
            z = z + fault(self.k, H @ self.x)
        line = np.zeros(1, self.dtype)[0]
        line["t_ns"], line["sensor"], line["dof"], line["used"] = round(self.k * p.dt_s * 1e9), i, len(R), 1
        line["T"][:] = p.A if first else np.eye(p.n)
        if p.B.shape[0] == p.n and first:
            line["B"][:] = p.B
        line["h"][: len(R)], line["hdot"][: len(R)] = H @ self.xhat, H @ rate
        L = np.linalg.cholesky(R)
        root_R = np.diag(L).copy()
        D = np.linalg.inv(L / root_R)
        nu, rows = D @ (z - H @ self.xhat), D @ H
        moved = np.zeros(p.n)
        for c in range(len(R)):
            h = rows[c]
            S = h @ self.P @ h + root_R[c] ** 2
            K = self.P @ h / S
            innovation = nu[c] - h @ moved
            line["e"][c], line["root"][c] = innovation / np.sqrt(S), np.sqrt(S)
            line["H"][c], line["K"][c], line["D"][c, : len(R)] = h, K, D[c]
            moved += K * innovation
            self.P = self.P - np.outer(K, h @ self.P)
        self.xhat = self.xhat + moved
        self.lines.append(line)

    def window(self, entries: int = 128) -> NDArray[Any]:
        return np.array(self.lines[-entries:], dtype=self.dtype)
