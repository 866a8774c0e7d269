"""The plain filter that the drive through Dresden is measured against, written apart from the engine.

Extended Kalman filter of x, y, yaw, speed, yaw rate (constant turn rate and velocity), Joseph form, as in the
published exercise with this recording: Q = diag(0.5 a dt^2, 0.5 a dt^2, 0.1 dt, a dt, dt)^2 with a = 8.8 m/s^2,
P0 = 1000 I, std of position 6 m, of speed 1 m/s, of yaw rate 0.1 rad/s; a position only where it is new.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tools.pages.recorded import Floats

STD = np.array([6.0, 6.0, 1.0, 0.1])
H = np.eye(5)[[0, 1, 3, 4]]


@dataclass(frozen=True, slots=True)
class Rows:
    """The recording by rows.

    Args:
        t_s: (N,).   z: (N, 4) x, y, speed, yaw rate.   course_rad: of the first row.   written_s: (N,) when the
            logger wrote the row.
    """

    t_s: Floats
    z: Floats
    course_rad: float
    written_s: Floats

    @property
    def fresh(self) -> NDArray[np.bool_]:
        """Whether the position differs from the row before."""
        return np.concatenate([[True], np.any(np.diff(self.z[:, :2], axis=0) != 0.0, axis=1)])


def moved(x: Floats, dt_s: float) -> tuple[Floats, Floats]:
    """x along its circle (or straight line) for dt_s, and the Jacobian."""
    _, _, yaw, speed, rate = x
    ahead = yaw + rate * dt_s
    if abs(rate) < 1e-4:
        way = speed * dt_s * np.array([np.cos(yaw), np.sin(yaw)])
    else:
        way = speed / rate * np.array([np.sin(ahead) - np.sin(yaw), np.cos(yaw) - np.cos(ahead)])
    F, middle = np.eye(5), 0.5 * (yaw + ahead)
    F[0, 2], F[1, 2], F[2, 4] = -way[1], way[0], dt_s
    F[0, 3], F[1, 3] = dt_s * np.cos(middle), dt_s * np.sin(middle)
    F[0, 4], F[1, 4] = -0.5 * speed * dt_s * F[1, 3], 0.5 * speed * dt_s * F[0, 3]
    return x + np.array([*way, rate * dt_s, 0.0, 0.0]), F


def filtered(rows: Rows, t_s: Floats, outage_s: tuple[float, float] = (-1.0, -1.0)) -> Floats:
    """Distance from each fresh position (N,), NaN elsewhere; before the update inside the outage, after it else.

    Args:
        t_s: (N,) times to believe.   outage_s: from and to, positions inside are withheld.
    """
    x = np.array([*rows.z[0, :2], rows.course_rad, *rows.z[0, 2:]])
    P = 1000.0 * np.eye(5)
    apart, fresh = np.full(len(t_s), np.nan), rows.fresh
    for k, dt_s in enumerate(np.diff(t_s, prepend=t_s[0])):
        x, F = moved(x, dt_s)
        q = np.array([4.4 * dt_s**2, 4.4 * dt_s**2, 0.1 * dt_s, 8.8 * dt_s, dt_s])
        P = F @ P @ F.T + np.diag(q**2)
        withheld = outage_s[0] <= t_s[k] < outage_s[1]
        use = slice(0, 4) if fresh[k] and not withheld else slice(2, 4)
        C, R = H[use], np.diag(STD[use] ** 2)
        K = np.linalg.solve(C @ P @ C.T + R, C @ P).T
        x = x + K @ (rows.z[k, use] - C @ x)
        reduced = np.eye(5) - K @ C
        P = reduced @ P @ reduced.T + K @ R @ K.T
        if fresh[k]:
            apart[k] = np.hypot(*(x[:2] - rows.z[k, :2]))
    return apart


def ends_m(rows: Rows, t_s: Floats, outage_s: tuple[float, float]) -> float:
    """Distance from the last position withheld."""
    apart = filtered(rows, t_s, outage_s)
    inside = (t_s >= outage_s[0]) & (t_s < outage_s[1]) & np.isfinite(apart)
    return float(apart[inside][-1])
