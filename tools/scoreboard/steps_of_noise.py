"""Noise that steps up and back: every method of adaptation beside the filter that is told R, on the same readings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fusiond.assembly.assembly import Assembly
from tools.scoreboard.plants import VELOCITY, Floats, Plant, plant_of
from tools.scoreboard.watching import assembled, readings_of

STAY = 500
"""Readings before the step, between up and down, and after."""
SPANS = {
    "low": slice(200, STAY), "high": slice(STAY + 200, 2 * STAY), "up": slice(STAY, STAY + 100),
    "down": slice(2 * STAY, 2 * STAY + 100),
}  # fmt: skip
"""Where each figure is taken: settled, and the hundred readings after each step."""
CHUNK = 250
"""Runs side by side."""


def configuration(**adaptation: Any) -> Mapping[str, Any]:
    """The constant-velocity plant with its declared R, its noise estimated."""
    sensor = {
        "kind": "linear", "H": [[1.0, 0.0]], "channels": ["y"], "rate_hz": 10.0, "noise_std": {"y": 0.1},
    }  # fmt: skip
    return {**VELOCITY, "sensor": {"y": sensor}, "adaptation": adaptation}


@dataclass(frozen=True, slots=True)
class Stepped:
    """Means over the runs of each chunk, (chunks,) by span; `error`, `oracle`: mean squares of the position's error."""

    error: dict[str, Floats]
    oracle: dict[str, Floats]
    nees: dict[str, Floats]
    nis: dict[str, Floats]

    def ratio(self, span: str) -> tuple[float, float]:
        """RMSE over the oracle's, and its standard error from the chunks (jackknife)."""
        a, b = self.error[span], self.oracle[span]
        whole, n = float(np.sqrt(a.sum() / b.sum())), len(a)
        if n < 2:
            return whole, float("nan")
        left = np.sqrt((a.sum() - a) / (b.sum() - b))
        return whole, float(np.sqrt((n - 1) / n * np.sum((left - left.mean()) ** 2)))

    def mean_nees(self, span: str) -> tuple[float, float]:
        """NEES and its standard error."""
        each = self.nees[span]
        return float(each.mean()), float(each.std(ddof=1) / np.sqrt(len(each))) if len(each) > 1 else float(
            "nan"
        )


def noise_std(R: float, factor: float) -> Floats:
    """(steps,) deviations of the noise: R, factor R, and R again."""
    return np.asarray(np.sqrt(np.repeat([R, factor * R, R], STAY)), dtype=np.float64)


def told(plant: Plant, z: Floats, R: Floats) -> Floats:
    """(runs, steps, n) estimates of the filter that knows R, (steps,), at every step."""
    n, Q = len(plant.A), (plant.G * plant.Q) @ plant.G.T
    x, P = np.zeros((len(z), n)), np.diag(plant.start**2)
    out, h = np.zeros((*z.shape, n)), plant.H[0]
    for k in range(z.shape[1]):
        if k > 0:
            x, P = x @ plant.A.T, plant.A @ P @ plant.A.T + Q
        K = P @ h / (h @ P @ h + R[k])
        x = x + np.outer(z[:, k] - x @ h, K)
        P = P - np.outer(K, h @ P)
        out[:, k] = x
    return out


def stepped(assembly: Assembly, factor: float, runs: int, seed: int) -> Stepped:
    """Run every chunk of noise through the engine and through the filter that knows."""
    plant, engine, rng = (
        plant_of(assembly.config.model_dump()),
        assembly.engine(),
        np.random.default_rng(seed),
    )
    std = noise_std(float(plant.R[0]), factor)
    found = Stepped({}, {}, {}, {})
    for _ in range(max(2, runs // CHUNK)):
        count = min(CHUNK, runs)
        clean, states = plant.wrong(R=0.0).run(rng, count, 3 * STAY)
        z = clean[:, :, 0] + rng.standard_normal(clean.shape[:2]) * std
        known = told(plant, z, std**2) - states
        x, nees, nis = np.zeros_like(states), np.zeros(z.shape), np.zeros(z.shape)
        for run, readings in enumerate(readings_of(assembly, z[:, :, None])):
            engine.reset()
            reports = engine.process(readings, covariances=True)
            x[run], nis[run] = reports["x"], reports["nis"]
            error = (x[run] - states[run])[:, :, None]
            P = engine.covariances[: len(readings)]
            nees[run] = (np.swapaxes(error, 1, 2) @ np.linalg.solve(P, error))[:, 0, 0]
        for name, span in SPANS.items():
            for kept, value in (
                (found.error, np.square(x - states)[:, span, 0]), (found.oracle, np.square(known)[:, span, 0]),
                (found.nees, nees[:, span]), (found.nis, nis[:, span]),
            ):  # fmt: skip
                kept[name] = np.append(kept.get(name, np.zeros(0)), value.mean())
    return found


TRUTHS = (0.4, 0.9, 1.7, 4.0)
"""True R over the declared one where a constant R is estimated: none is where the estimate begins."""


def estimate_spread(runs: int, seed: int) -> list[tuple[float, float]]:
    """Of each of TRUTHS: rms error of a constant R after STAY readings, over R, and the Whittle bound of the same.

    The window grows: noise is told never to jump.
    """
    assembly = assembled(configuration(readings_between_jumps=float("inf")))
    engine, found = assembly.engine(), []
    for number, truth in enumerate(TRUTHS):
        plant = plant_of(assembly.config.model_dump()).wrong(R=truth)
        z = plant.run(np.random.default_rng(seed + number), runs, STAY + 1)[0]
        last = np.zeros(runs)
        for run, readings in enumerate(readings_of(assembly, z)):
            engine.reset()
            last[run] = engine.process(readings)["R_used"][-1, 0] / plant.R[0]
        found.append((float(np.sqrt(np.mean((last - 1.0) ** 2))), whittle(plant) / float(np.sqrt(STAY))))
    return found


def whittle(plant: Plant, points: int = 200_001) -> float:
    """sqrt(2 / mean over frequency of (R / spectrum of the reading)^2): no estimate of R does better, times 1/sqrt(N).

    Source: Whittle 1953; theory in docs/adaptation.md.
    """
    w = (np.arange(points) + 0.5) / points * np.pi
    n = len(plant.A)
    response = plant.H[0] @ np.linalg.solve(
        np.exp(1j * w)[:, None, None] * np.eye(n) - plant.A, plant.G * np.sqrt(plant.Q)
    )
    spectrum = plant.R[0] + np.sum(np.abs(response.reshape(points, -1)) ** 2, axis=1)
    return float(np.sqrt(2.0 / np.mean((plant.R[0] / spectrum) ** 2)))
