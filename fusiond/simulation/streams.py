"""One seed, one independent random stream per name.

A stream depends on the seed and its own name only, so adding, dropping or reordering sensors changes no other
sensor's noise, and never the truth.
"""

from __future__ import annotations

import numpy as np


def stream(seed: int, name: str) -> np.random.Generator:
    """The generator of (seed, name); those of different names are independent (numpy's SeedSequence)."""
    return np.random.default_rng(np.random.SeedSequence(entropy=seed, spawn_key=tuple(name.encode())))
