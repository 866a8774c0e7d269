"""The rows of seed 000: four scenarios of two examples, and the offset without a bias state."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from fusiond.simulation.closed_loop import LoopRun
from tools.pages import seed_000
from tools.pages.seed_000 import EXAMPLES, LAST_S, Example
from tools.pages.seed_row import Row, between, near
from tools.pages.trials import Steered

SEEDS = range(8)


@cache
def steered(example: Example, seed: int) -> Steered:
    """The fused loop, run once."""
    return seed_000.fused(example, seed)


def rms_mm(example: Example, seed: int) -> float:
    """Fused: root mean square distance from the goal over the last 10 s, mm."""
    return 1e3 * steered(example, seed).loop.rms_from(example.goal_m, LAST_S)


def ensemble_mm(example: Example) -> float:
    """The same over several seeds together, mm."""
    return float(np.sqrt(np.mean([rms_mm(example, seed) ** 2 for seed in SEEDS])))


def velocity_error_mm_s(example: Example) -> float:
    """Root mean square error of the fused velocity over the last 10 s, mm/s."""
    run = steered(example, 0)
    late = run.loop.t_ns >= run.loop.t_ns[-1] - int(LAST_S * 1e9)
    return 1e3 * float(np.sqrt(np.mean((run.x[late, 1] - run.loop.states[late, 1]) ** 2)))


def late_force_std_n(loop: LoopRun) -> float:
    """How much the force trembles over the last 10 s, N."""
    return float(np.std(loop.force_n[loop.t_ns >= loop.t_ns[-1] - int(LAST_S * 1e9)]))


def ultrasonic_ensemble_mm(example: Example) -> float:
    """Ultrasonic only, several seeds together, mm."""
    runs = [seed_000.unfused(example, "ultrasonic", seed) for seed in SEEDS]
    return 1e3 * float(np.sqrt(np.mean([run.rms_from(example.goal_m, LAST_S) ** 2 for run in runs])))


def unfused_rms(example: Example, scenario: str) -> Callable[[], float]:
    """Root mean square distance from the goal over the last 10 s without a filter, m."""
    return lambda: seed_000.unfused(example, scenario).rms_from(example.goal_m, LAST_S)


def example_rows(example: Example) -> list[Row]:
    """The four scenarios of one example."""
    name = example.name
    return [
        Row(f"{name}, ideal sensors", "0", unfused_rms(example, "ideal"), "{:.5f} m", between(0.0, 1e-4)),
        Row(
            f"{name}, accelerometer only",
            "drifts off by hundreds of metres",
            unfused_rms(example, "accelerometer"),
            "{:.0f} m",
            between(200.0, 500.0),
        ),
        Row(
            f"{name}, ultrasonic only, seeds 0 to 7 together",
            "arrives; 4.7 mm in one run",
            lambda: ultrasonic_ensemble_mm(example),
            "{:.2f} mm",
            between(3.0, 8.0),
            cheap=False,
        ),
        Row(
            f"{name}, ultrasonic only, trembling of the force",
            "none stated",
            lambda: late_force_std_n(seed_000.unfused(example, "ultrasonic")),
            "{:.3f} N",
            between(0.3, 0.6),
        ),
        Row(
            f"{name}, fused, seed 0", "<= 2.5 mm", lambda: rms_mm(example, 0), "{:.2f} mm", between(0.0, 2.5)
        ),
        Row(
            f"{name}, fused, seeds 0 to 7 together",
            "<= 2.5 mm",
            lambda: ensemble_mm(example),
            "{:.2f} mm",
            between(0.0, 2.5),
            cheap=False,
        ),
        Row(
            f"{name}, fused, worst of these runs",
            "none stated",
            lambda: max(rms_mm(example, seed) for seed in SEEDS),
            "{:.2f} mm",
            between(0.0, 5.0),
            cheap=False,
        ),
        Row(
            f"{name}, fused, trembling of the force",
            "none stated",
            lambda: late_force_std_n(steered(example, 0).loop),
            "{:.4f} N",
            between(0.0, 0.01),
        ),
        Row(
            f"{name}, fused, error of the velocity",
            "usable; ultrasonic only: 470 mm/s",
            lambda: velocity_error_mm_s(example),
            "{:.2f} mm/s",
            between(0.0, 5.0),
        ),
    ]


def rows() -> list[Row]:
    """The scenarios."""
    return [row for example in EXAMPLES for row in example_rows(example)]


def offset_row(Q22: float, table_m: float) -> Row:
    """Where the car stops without a bias state; the cheap one is in the middle of the table."""
    formula_m = seed_000.predicted_offset_m(Q22)
    return Row(
        f"Q22 = {Q22:.0e}",
        f"{table_m:.3f} m; formula {formula_m:.4f} m",
        lambda: seed_000.offset_m(Q22),
        "{:.4f} m",
        near(formula_m, 0.02),
        cheap=Q22 == 1e-6,
    )


def offset_rows() -> list[Row]:
    """The offset by Q22."""
    return [offset_row(Q22, table_m) for Q22, table_m in seed_000.OFFSETS_M.items()]
