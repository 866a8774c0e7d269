"""Picture of seed 003: the square as driven and as estimated, and where a hundred runs end. Needs matplotlib."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from fusiond.simulation.registry import simulate
from tools.pages.figures import figure
from tools.pages.seed_003 import GYRO_RUNS, alone, ends, paths

TRUTH, ALONE, FUSED, GYRO = "#222222", "#d1495b", "#edae49", "#00798c"
SEED = 16
"""Of the run that is shown: its errors are about as large as the root mean square of all."""


def square(path: Path) -> None:
    """One run's paths; the end points of all runs."""
    kinds = (
        ("encoders alone", ALONE, alone(GYRO_RUNS)),
        ("fused: with accelerometer", FUSED, paths("square_robot", GYRO_RUNS)),
        ("with a gyro too", GYRO, paths("square_robot_gyro", GYRO_RUNS)),
    )
    truth = simulate("square_robot", SEED).truth
    with figure(path, 9.4, 4.6) as drawn:
        left, right = drawn.subplots(1, 2)
        left.plot(truth.column("x")[::5], truth.column("y")[::5], color="#bbbbbb", lw=5.0, label="truth")
        for name, colour, found in kinds:
            one = found[SEED]
            dashed = "--" if colour == FUSED else "-"
            left.plot(one.x_m[::5], one.y_m[::5], dashed, color=colour, lw=1.3, label=name)
            left.plot(*one.end_m, "o", color=colour, ms=5)
            points = 100.0 * ends(found)
            right.plot(points[:, 0], points[:, 1], ".", color=colour, ms=5, label=name, alpha=0.8)
        left.set(
            xlabel="X, m",
            ylabel="Y, m",
            title=f"square_robot, seed {SEED}; dots: where it ends",
            aspect="equal",
        )
        left.legend(loc="center")
        _cross(right)
        right.set(
            xlabel="end in X, cm", ylabel="end in Y, cm", title=f"where {GYRO_RUNS} runs end", aspect="equal"
        )


def _cross(axes: Any) -> None:
    """The origin, where every run ends in truth, and the 5 cm around it."""
    axes.axhline(0.0, color="#999999", lw=0.7)
    axes.axvline(0.0, color="#999999", lw=0.7)
    side = np.array([-5.0, 5.0, 5.0, -5.0, -5.0])
    axes.plot(side, np.roll(side, 1)[[0, 1, 2, 3, 0]], color=TRUTH, lw=1.0)
    axes.text(6.0, 6.0, "5 cm", color=TRUTH)
