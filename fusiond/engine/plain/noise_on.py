"""Adaptation in a plain step: the R of every reading estimated before it is fused, whatever the recursion.

`assembly` copies this file over `noise.py`. The methods are the compiled step's own kernels with the compiler taken
away; what an update cannot express, the spread that interacting models add to the covariance, is left out, and the R
reported is that of the update, the reading counted.
In a decentralized topology the sensor's own local filter estimates, else the estimate of all sensors does. While the
judge has an alarm open that the sensor's noise does not explain, either stands still: it is what weighs the sensor.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.adapt.guards import held
from fusiond.adapt.records import OWN, PRIMARY
from fusiond.engine.step.method import weigh
from fusiond.filters.innovation import Matrix


def trusted(track: Any, design: Any, work: Any, row: int, reading: Any, P: Matrix) -> None:
    """Let the method weigh each decorrelated channel, and write its R into work.R_d.

    Reads work.nu, H, R_U, R_d of the reading; leaves nu and H as they were. Writes track.noise.
    """
    sensor, noise, made, said = reading.sensor, track.noise, design.noise, work.noise.weighed
    m, k = design.dof[sensor], OWN if row > 0 else PRIMARY
    work.noise.declared[:m] = work.R_d[:m]
    learns = made.adapts[sensor] and not noise.frozen[sensor]
    apart = np.linalg.inv(np.triu(work.R_U[:m, :m], 1) + np.eye(m))
    nu, H, x = apart @ work.nu[:m], apart @ work.H[:m], np.zeros(P.shape[0])
    for i in range(m):
        declared_r, before = work.R_d[i], noise.trusted[k, sensor, i]
        cross = P @ H[i]
        through, left = float(H[i] @ cross), float(nu[i] - H[i] @ x)
        r = declared_r * before
        if learns and declared_r > 0.0:
            memory = noise.memory[k, sensor, i]
            weigh(memory, made, sensor, i, before, left / np.sqrt(declared_r), through / declared_r, said)
            lowest, highest = made.floor[sensor, i], made.ceiling[sensor, i]
            noise.trusted[k, sensor, i] = held(said[1], before, lowest, highest, made.most)
            r = declared_r * min(max(said[0], lowest), highest)
        work.R_d[i] = r
        if through + r > 0.0:
            x, P = x + cross * (left / (through + r)), P - np.outer(cross, cross) / (through + r)


def declared(work: Any, i: int, variance: float) -> float:
    """The declared variance of raw channel i, of which `variance` is used."""
    total = float(work.noise.declared[i])
    for j in range(i + 1, work.R_d.shape[0]):
        total += work.R_U[i, j] ** 2 * work.noise.declared[j]
    return total
