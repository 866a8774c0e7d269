"""Linear plants for Monte Carlo, many runs side by side, written apart from the engine that judges their readings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tools.pages.trials import merged

Floats = NDArray[np.float64]

STATIC: dict[str, Any] = {
    "name": "static",
    "model": {"kind": "linear", "step_s": 1.0, "states": ["x"], "A": [[0.5]], "G": [[1.0]], "Q": [[1e-8]]},
    "initial": {"std": {"x": 1e-4}},
}
"""A state known almost exactly: the innovations are the reading's own noise, the signature of a bias is constant."""
REFERENCE: dict[str, Any] = {
    "name": "reference",
    "model": {
        "kind": "linear", "step_s": 1.0, "states": ["x1", "x2", "x3"],
        "A": [[1.1269, -0.4940, 0.1129], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        "G": [[-0.3832], [0.5919], [0.5191]], "Q": [[2.3]],
    },
    "initial": {"std": {"x1": 0.5811516, "x2": 0.8976608, "x3": 0.7872541}},
}  # fmt: skip
"""Seed 004's plant; its known input, which the innovations do not show, is left out."""
VELOCITY: dict[str, Any] = {
    "name": "velocity",
    "model": {
        "kind": "linear", "step_s": 0.1, "states": ["position", "velocity"],
        "A": [[1.0, 0.1], [0.0, 1.0]], "G": [[0.005], [0.1]], "Q": [[1.0]],
    },
    "initial": {"std": {"position": 1.0, "velocity": 1.0}},
}  # fmt: skip
"""The constant-velocity plant: a bias of its only sensor shows for a while and never again."""


def sensed(
    plant: Mapping[str, Any], noise: Mapping[str, float], interval_s: float, **faults: Any
) -> dict[str, Any]:
    """The plant's configuration with sensors of its first state, by name with their noise, and one promise."""
    states = len(plant["model"]["states"])
    rate = 1.0 / plant["model"]["step_s"]
    sensors = {
        name: {
            "kind": "linear", "H": [[1.0] + [0.0] * (states - 1)], "channels": ["y"], "rate_hz": rate,
            "noise_std": {"y": std},
        }
        for name, std in noise.items()
    }  # fmt: skip
    section = {"mean_time_between_false_alarms_s": interval_s, **faults}
    return merged(plant, {"sensor": sensors, "faults": section})


@dataclass(frozen=True, slots=True)
class Plant:
    """x+ = A x + G w, z = H x + v with independent noises.

    Args:
        A: (n, n).   G: (n, k).   Q: (k,) variances.   H: (s, n).   R: (s,) variances.   start: (n,) deviations.
        correlation: of each sensor's successive noises, which keep their variance.
    """

    A: Floats
    G: Floats
    Q: Floats
    H: Floats
    R: Floats
    start: Floats
    correlation: float = 0.0

    def wrong(self, R: float = 1.0, Q: float = 1.0, correlation: float = 0.0) -> Plant:
        """The plant with other noise than its configuration says: variances times R and Q."""
        return replace(self, R=self.R * R, Q=self.Q * Q, correlation=correlation)

    def run(self, rng: np.random.Generator, runs: int, steps: int) -> tuple[Floats, Floats]:
        """Readings (runs, steps, s) and states (runs, steps, n)."""
        n, s = len(self.A), len(self.H)
        states, noise = np.zeros((runs, steps, n)), rng.standard_normal((runs, steps, s))
        x = rng.standard_normal((runs, n)) * self.start
        pushed = (rng.standard_normal((runs, steps, len(self.Q))) * np.sqrt(self.Q)) @ self.G.T
        for k in range(steps):
            states[:, k] = x
            x = x @ self.A.T + pushed[:, k]
        fresh = np.sqrt(1.0 - self.correlation**2)
        for k in range(1, steps) if self.correlation else ():
            noise[:, k] = self.correlation * noise[:, k - 1] + fresh * noise[:, k]
        return states @ self.H.T + noise * np.sqrt(self.R), states


def plant_of(config: Mapping[str, Any]) -> Plant:
    """The plant that a linear configuration describes, each sensor with one channel."""
    model, sensors = config["model"], list(config["sensor"].values())
    updating = [sensor for sensor in sensors if sensor["kind"] == "linear"]
    stds = config["initial"]["std"]
    return Plant(
        np.array(model["A"]), np.array(model["G"]), np.diagonal(np.array(model["Q"])).copy(),
        np.array([sensor["H"][0] for sensor in updating]),
        np.array([float(next(iter(sensor["noise_std"].values()))) ** 2 for sensor in updating]),
        np.array([float(stds[name]) for name in model["states"]]),
    )  # fmt: skip
