"""One engine with adaptation that its tests share: constant velocity, one scalar sensor, faults watched.

Everything that a test changes are numbers of the design record, so that nothing is compiled again.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.assembly import Assembly, load

CONFIG = Path(__file__).resolve().parents[2] / "configs" / "noisy_range.toml"
STEP_NS = 100_000_000
R = 0.01


@functools.cache
def adapted() -> Assembly:
    """configs/noisy_range.toml, assembled once."""
    return load(CONFIG)


def measured(steps: int, std: NDArray[np.float64] | float, seed: int) -> NDArray[np.float64]:
    """(steps,) readings of a point at constant velocity, disturbed as configured, with noise of this deviation."""
    rng = np.random.default_rng(seed)
    x, v, z = rng.standard_normal(), rng.standard_normal(), np.zeros(steps)
    for k in range(steps):
        z[k] = x
        a = rng.standard_normal()
        x, v = x + 0.1 * v + 0.005 * a, v + 0.1 * a
    return z + std * rng.standard_normal(steps)


def readings_of(z: NDArray[np.float64]) -> NDArray[Any]:
    """Readings every 0.1 s."""
    readings = np.zeros(len(z), adapted().layout.reading)
    readings["t_ns"] = (np.arange(len(z)) + 1) * STEP_NS
    readings["length"], readings["z"][:, 0] = 1, z
    return readings
