"""Pictures of seed 004's filters, as SVG with the same bytes at every run. Needs matplotlib."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tools.pages.figures import figure
from tools.pages.seed_004_modes import plant, replayed

COLOURS = ("#d1495b", "#edae49", "#8d6a9f", "#00798c")


def start(path: Path) -> None:
    """max |P - P of Model 1| step by step, for each reading of the seed's random diagonal and the Woodbury form."""
    exact = replayed(plant((1.0,), recursion="conventional"), (1.0,), 60).P[1::2]
    readings = {
        "deviation 1e-14": "deviation", "variance 1e-4": "identity_variance",
        "deviation 1e-4": "identity_deviation", "variance 1e-14": "variance",
    }  # fmt: skip
    with figure(path, 6.4, 3.4) as drawn:
        axes = drawn.subplots()
        for (label, reading), colour in zip(readings.items(), COLOURS, strict=True):
            P = replayed(plant((1.0,), recursion="seed", seed_diagonal=reading), (1.0,), 60).P[1::2]
            axes.semilogy(error_of(P, exact), color=colour, lw=1.2, label=f"random diagonal, {label}")
        woodbury = replayed(plant((1.0,), recursion="information"), (1.0,), 60).P[1::2]
        axes.semilogy(error_of(woodbury, exact), color="#222222", lw=1.2, label="Woodbury form, no repair")
        axes.set(xlabel="step", ylabel="largest error of P", ylim=(1e-17, 1.0))
        axes.legend(loc="upper right", fontsize=8)


def error_of(P: np.ndarray, exact: np.ndarray) -> np.ndarray:
    """(steps,) largest element of |P - exact|, no less than a float can tell."""
    return np.asarray(np.maximum(np.abs(P - exact).max(axis=(1, 2)), 1e-17))


def averaged(path: Path) -> None:
    """tr P with 1 to 10 equal sensors: optimal, and what the averaged gain reports and is."""
    counts = (1, 2, 3, 4, 6, 8, 10)
    optimal, reported, true = [], [], []
    for count in counts:
        R = (1.0,) * count
        optimal.append(np.trace(replayed(plant(R, topology="stacked"), R, 60).engine.covariance()))
        engine = replayed(plant(R, topology="seed_averaged"), R, 60).engine
        honest = engine.honest_covariance()
        assert honest is not None
        reported.append(np.trace(engine.covariance()))
        true.append(np.trace(honest))
    with figure(path, 5.6, 3.2) as drawn:
        axes = drawn.subplots()
        for label, values, colour in (
            ("averaged gain, reported (5-6)", reported, COLOURS[0]),
            ("averaged gain, true", true, COLOURS[1]),
            ("optimal", optimal, COLOURS[3]),
        ):
            axes.plot(counts, values, "o-", color=colour, lw=1.3, ms=4, label=label)
        axes.set(xlabel="equal sensors", ylabel="tr P at rest", ylim=(0.0, 3.6))
        axes.legend(loc="lower left", fontsize=8)


def draw(folder: Path) -> None:
    """Both pictures."""
    start(folder / "seed_004_start.svg")
    averaged(folder / "seed_004_averaged.svg")
