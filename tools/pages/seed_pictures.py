"""Pictures of the seeds, as SVG with the same bytes at every run. Needs matplotlib."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from fusiond.simulation.registry import simulate
from tools.pages import seed_000, seed_001, seed_003_pictures, seed_004
from tools.pages.figures import figure
from tools.pages.seed_000 import EXAMPLES, Example
from tools.pages.seed_000_rows import steered
from tools.pages.trials import Floats, configured, estimate

IDEAL, ACCELEROMETER, ULTRASONIC, FUSED, BARE = "#222222", "#d1495b", "#edae49", "#00798c", "#8d6a9f"


def thin(values: Any, every: int = 50) -> Any:
    """Every so many rows: 20 a second is more than a picture shows."""
    return values[::every]


def scenarios(example: Example, path: Path) -> None:
    """The four scenarios: position, and distance from the goal on a logarithmic scale."""
    fused = steered(example, 0).loop
    loops = [
        ("accelerometer only", ACCELEROMETER, seed_000.unfused(example, "accelerometer")),
        ("ultrasonic only", ULTRASONIC, seed_000.unfused(example, "ultrasonic")),
        ("ideal sensors", IDEAL, seed_000.unfused(example, "ideal")),
        ("fused, with a bias state", FUSED, fused),
    ]
    with figure(path, 9.0, 3.4) as drawn:
        left, right = drawn.subplots(1, 2)
        for name, colour, loop in loops:
            t_s, x_m = thin(loop.t_ns) / 1e9, thin(loop.states[:, 0])
            dashed = "--" if name == "ideal sensors" else "-"
            left.plot(t_s, x_m, dashed, color=colour, label=name, lw=1.4)
            right.semilogy(t_s, np.maximum(np.abs(x_m - example.goal_m), 1e-5), dashed, color=colour, lw=1.1)
        left.axhline(example.goal_m, color="#999999", lw=0.8, ls=":")
        left.set(
            xlim=(0, 15), ylim=(0.0, 3.0), xlabel="time, s", ylabel="true position, m", title=example.name
        )
        left.legend(loc="lower right" if example.name == "minicar" else "upper right")
        right.set(xlim=(0, 30), ylim=(1e-5, 1e3), xlabel="time, s", ylabel="distance from the goal, m")
        right.text(29.5, 30.0, "runs away", color=ACCELEROMETER, ha="right")


def offset(path: Path) -> None:
    """Where the car stops without a bias state, by Q22: formula and loop."""
    Q22 = np.logspace(-8.5, -2.5, 61)
    with figure(path, 5.6, 3.3) as drawn:
        axes = drawn.subplots()
        axes.loglog(
            Q22,
            [seed_000.predicted_offset_m(q) for q in Q22.tolist()],
            color=BARE,
            label="formula, steady gain",
        )
        loops = [seed_000.offset_m(q) for q in seed_000.OFFSETS_M]
        axes.loglog(list(seed_000.OFFSETS_M), loops, "o", color=BARE, label="closed loop, two states")
        bound = steered(EXAMPLES[0], 0).loop.rms_from(EXAMPLES[0].goal_m, seed_000.LAST_S)
        axes.axhline(bound, color=FUSED, label="closed loop, with a bias state (RMS)")
        axes.set(xlabel="Q22 a sample, (m/s)$^2$", ylabel="offset from the goal, m", ylim=(5e-4, 5.0))
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 0.12))


def wall_robot(path: Path) -> None:
    """One run of seed 001: position with 3-sigma band, errors of both filters, and their share outside."""
    run = seed_001.simulations()[0]
    t_s = run.truth.t_ns / 1e9
    with figure(path, 9.0, 4.6) as drawn:
        above, below = drawn.subplots(2, 1, sharex=True)
        above.plot(t_s, run.of("range")[1][:, 0], ".", color=ULTRASONIC, ms=4, label="range finder")
        above.plot(t_s, run.truth.column("position"), color=IDEAL, lw=1.0, label="truth")
        kinds = (("wall_robot", FUSED, "corrected"), ("wall_robot_as_written", ACCELEROMETER, "as printed"))
        for name, colour, label in kinds:
            trial = estimate(configured(name).engine(), run)
            rows = trial.of("range")
            if name == "wall_robot":
                above.plot(
                    t_s, trial.reports["x"][rows, 0], color=colour, lw=1.2, label="estimate, corrected"
                )
                band: Floats = 3.0 * np.sqrt(trial.P[rows, 0, 0])
                below.fill_between(
                    t_s, -band, band, color="#999999", alpha=0.2, lw=0, label="+-3 sigma, of both"
                )
                below.fill_between(
                    t_s, -band / 3, band / 3, color="#999999", alpha=0.3, lw=0, label="+-1 sigma, the seed's"
                )
            below.plot(t_s, trial.error[rows, 0], color=colour, lw=1.2, label=f"error, {label}")
        above.set(ylabel="position, m", title="wall_robot, seed 0")
        above.legend(ncols=3, loc="upper left")
        below.set(ylabel="error, m", xlabel="time, s", xlim=(0, 10), ylim=(-0.12, 0.1))
        below.legend(ncols=4, loc="lower left")


def settling(path: Path) -> None:
    """How the reference plant's gain settles, against the published values."""
    with figure(path, 5.6, 3.3) as drawn:
        axes = drawn.subplots()
        trial = estimate(
            configured("reference_plant").engine(), simulate("reference_plant", 0, 15.0, R=(1.0,))
        )
        rows = trial.of("y1")
        for state, colour in enumerate((FUSED, ULTRASONIC, ACCELEROMETER)):
            axes.plot(
                np.arange(rows.size),
                trial.P[rows][:, state, 0],
                "o-",
                color=colour,
                ms=3,
                label=f"M{state + 1}",
            )
            axes.axhline(seed_004.M_EXPECTED[2.3][state], color=colour, lw=0.8, ls=":")
        axes.set(
            xlabel="reading of y1", ylabel="gain", title="reference_plant, Q = 2.3, R = 1 (dotted: published)"
        )
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.12))


PICTURES: dict[str, Callable[[Path], None]] = {
    "seed_000_minicar": lambda path: scenarios(EXAMPLES[0], path),
    "seed_000_birotor": lambda path: scenarios(EXAMPLES[1], path),
    "seed_000_offset": offset,
    "seed_001_wall_robot": wall_robot,
    "seed_003_square": seed_003_pictures.square,
    "seed_004_reference_plant": settling,
}
"""Every picture by its file's name."""


def draw(folder: Path, suffix: str = ".svg") -> None:
    """Draw every picture into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, picture in PICTURES.items():
        picture(folder / f"{name}{suffix}")
