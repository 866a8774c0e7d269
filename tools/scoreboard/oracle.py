"""The oracle: a CUSUM that knows profile and size of a fault and lacks its onset alone.

    max over onsets t of  sum over k = t ... now of  w(k - t) e(k) - w(k - t)^2 / 2,      alarm at h, then anew

On the innovations e of the plain settled filter. With the onset as the only unknown no test beats this one; its
threshold is set so that on healthy innovations it raises as many false alarms as the engine's tests did in as long a
time. Test: tests/calibration/test_scoreboard.py.
"""

from __future__ import annotations

import numpy as np

from fusiond.numerics.kernel import entry
from tools.scoreboard.plants import Floats, Plant


@entry
def first_alarms(e: Floats, w: Floats, h: float, onset: int, again: bool, delays: Floats) -> int:
    """Alarms in (runs, k) whitened innovations for the (W,) profile w; delays[run]: the first from the onset on.

    Onsets older than the profile are given up. Without `again` a run ends with its first alarm from the onset on.
    """
    W, count = w.shape[0], 0
    llr = np.zeros(W)
    for run in range(e.shape[0]):
        llr[:] = 0.0
        age, found = 0, False
        for k in range(e.shape[1]):
            # llr[j]: the fault began j readings ago
            age = min(age + 1, W)
            for j in range(age - 1, 0, -1):
                llr[j] = llr[j - 1] + w[j] * (e[run, k] - 0.5 * w[j])
            llr[0] = w[0] * (e[run, k] - 0.5 * w[0])
            best = llr[0]
            for j in range(1, age):
                best = max(best, llr[j])
            if best >= h:
                count += 1
                age = 0
                if k >= onset and not found:
                    delays[run] = k - onset + 1.0
                    found = True
                    if not again:
                        break
    return count


def threshold(e: Floats, w: Floats, interval: float) -> float:
    """Threshold at which the mean time between alarms on healthy (runs, k) innovations is `interval` readings."""
    delays = np.full(len(e), np.inf)
    low, high = max(np.log(interval) - 6.0, 0.5), np.log(interval) + 1.0
    wanted = e.size / interval
    for _ in range(9):
        h = 0.5 * (low + high)
        low, high = (h, high) if first_alarms(e, w, h, 0, True, delays) > wanted else (low, h)
    return float(0.5 * (low + high))


def delays_of(e: Floats, w: Floats, h: float, onset: int) -> Floats:
    """(runs,) readings from the onset (1: with the first faulty one) to the alarm; infinite without one."""
    delays = np.full(len(e), np.inf)
    first_alarms(e, w, h, onset, False, delays)
    return delays


def settled(plant: Plant) -> tuple[Floats, Floats]:
    """Gain (n,) and innovation variance of the settled filter of a plant with one sensor, not the engine's."""
    A, H = plant.A, plant.H[0]
    noise = (plant.G * plant.Q) @ plant.G.T
    P = np.diag(plant.start**2)
    for _ in range(2000):
        S = H @ P @ H + plant.R[0]
        K = P @ H / S
        P = A @ (P - np.outer(K, H @ P)) @ A.T + noise
        P = 0.5 * (P + P.T)
    return K, np.asarray(S)


def profile(plant: Plant, fault: Floats) -> Floats:
    """(W,) whitened mean of the settled filter's innovations while the sensor errs by fault[0], fault[1], ..."""
    K, S = settled(plant)
    error = np.zeros(len(plant.A))
    means = np.zeros(len(fault))
    for k, f in enumerate(fault):
        rho = f - plant.H[0] @ error
        means[k] = rho / np.sqrt(S)
        error = plant.A @ (error + K * rho)
    return means
