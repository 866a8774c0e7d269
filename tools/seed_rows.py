"""What the page of the seeds promises: one row for each figure, measured when asked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from tools import seed_000, seed_001, seed_004
from tools.seed_000 import EXAMPLES, LAST_S, Example
from tools.trials import Steered

SEEDS = range(8)


@dataclass(frozen=True, slots=True)
class Row:
    """One figure.

    expected: as it stands on the page, with where it comes from.   measure: runs what the figure is about.
    form: how it is written.   holds: whether it is as expected.   cheap: whether `--check` measures it again.
    """

    what: str
    expected: str
    measure: Callable[[], float]
    form: str
    holds: Callable[[float], bool]
    cheap: bool = True

    def written(self) -> str:
        """The row as a line of a table."""
        value = self.measure()
        return f"| {self.what} | {self.expected} | {self.form.format(value)} | {'yes' if self.holds(value) else '**no**'} |"


def near(expected: float, relative: float) -> Callable[[float], bool]:
    """Holds within a relative distance."""
    return lambda value: abs(value - expected) <= relative * abs(expected)


def between(low: float, high: float) -> Callable[[float], bool]:
    """Holds from low to high."""
    return lambda value: low <= value <= high


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


def unfused_rms(example: Example, scenario: str) -> Callable[[], float]:
    """Root mean square distance from the goal over the last 10 s without a filter, m."""
    return lambda: seed_000.unfused(example, scenario).rms_from(example.goal_m, LAST_S)


def example_rows(example: Example) -> list[Row]:
    """The four scenarios of one example."""
    name = example.name
    return [
        Row(f"{name}, ideal sensors", "0", unfused_rms(example, "ideal"), "{:.5f} m", between(0.0, 1e-4)),
        Row(
            f"{name}, accelerometer only", "drifts off by hundreds of metres", unfused_rms(example, "accelerometer"),
            "{:.0f} m", between(200.0, 500.0),
        ),
        Row(
            f"{name}, ultrasonic only", "arrives; 4.7 mm", lambda: 1e3 * unfused_rms(example, "ultrasonic")(),
            "{:.1f} mm", between(1.0, 10.0),
        ),
        Row(f"{name}, fused, seed 0", "<= 2.5 mm", lambda: rms_mm(example, 0), "{:.2f} mm", between(0.0, 2.5)),
        Row(
            f"{name}, fused, seeds 0 to 7 together", "<= 2.5 mm", lambda: ensemble_mm(example), "{:.2f} mm",
            between(0.0, 2.5), cheap=False,
        ),
        Row(
            f"{name}, fused, worst of these runs", "none stated", lambda: max(rms_mm(example, seed) for seed in SEEDS),
            "{:.2f} mm", between(0.0, 5.0), cheap=False,
        ),
        Row(
            f"{name}, fused, error of the velocity", "usable; ultrasonic only: 470 mm/s",
            lambda: velocity_error_mm_s(example), "{:.2f} mm/s", between(0.0, 5.0),
        ),
    ]  # fmt: skip


def rows_000() -> list[Row]:
    """Seed 000's scenarios."""
    return [row for example in EXAMPLES for row in example_rows(example)]


def rows_offset() -> list[Row]:
    """Seed 000 without a bias state: where the car stops, by Q22."""
    rows = []
    for Q22, table_m in seed_000.OFFSETS_M.items():
        formula_m = seed_000.predicted_offset_m(Q22)
        rows.append(
            Row(
                f"Q22 = {Q22:.0e}", f"{table_m:.3f} m; formula {formula_m:.4f} m",
                lambda Q22=Q22: seed_000.offset_m(Q22), "{:.4f} m", near(formula_m, 0.02), cheap=Q22 == 1e-6,
            )
        )  # fmt: skip
    return rows


def rows_001() -> list[Row]:
    """Seed 001, corrected and as printed."""
    exact = seed_001.closed_form()

    def corrected() -> seed_001.Figures:
        return seed_001.figures("wall_robot")

    def printed() -> seed_001.Figures:
        return seed_001.figures("wall_robot_as_written")

    return [
        Row("gain K", f"{exact.gain:.5f} (closed form)", lambda: corrected().steady.gain, "{:.5f}", near(exact.gain, 1e-6)),
        Row(
            "variance after a range, P+", f"{exact.P_after:.4e} m^2 (closed form)", lambda: corrected().steady.P_after,
            "{:.4e} m^2", near(exact.P_after, 1e-6),
        ),
        Row("range finder alone, RMSE", "0.0300 m", seed_001.raw_rmse_m, "{:.5f} m", near(0.03, 0.02)),
        Row("corrected, RMSE of 400 runs", "0.0208 m (root of P+) within 2 %", lambda: corrected().rmse_m, "{:.5f} m", near(exact.P_after**0.5, 0.02)),
        Row("corrected, NEES", "1.00; 1.01 found before", lambda: corrected().nees_mean, "{:.3f}", near(1.0, 0.03)),
        Row("as printed, RMSE of 400 runs", "0.02269 m", lambda: printed().rmse_m, "{:.5f} m", near(0.02269, 0.02)),
        Row("as printed, NEES", "1.19: more sure of itself than it may be", lambda: printed().nees_mean, "{:.3f}", near(1.19, 0.03)),
        Row("corrected, errors inside the plotted +-1 sigma", "68.3 %", lambda: 100.0 * corrected().within_one_sigma, "{:.1f} %", between(67.0, 69.5)),
    ]  # fmt: skip


def rows_004() -> list[Row]:
    """Where the filters of the two linear plants settle."""
    settled = cache(seed_004.reference_plant)
    constant_velocity = cache(seed_004.constant_velocity)
    rows = []
    for Q, M in seed_004.M_EXPECTED.items():
        digits = 4 if Q == 1.0 else 6
        for state, expected in enumerate(M):
            rows.append(
                Row(
                    f"reference_plant, Q = {Q:g}, R = 1, gain M{state + 1}", f"{expected:.{digits}f}",
                    lambda Q=Q, state=state: float(settled(Q).M[state]), "{:.6f}",
                    lambda value, expected=expected, digits=digits: abs(value - expected) < 0.6 * 10.0**-digits,
                )
            )  # fmt: skip
        S, y = seed_004.S_EXPECTED[Q], seed_004.Y_VARIANCE_EXPECTED[Q]
        rows += [
            Row(f"reference_plant, Q = {Q:g}, R = 1, innovation variance S", f"{S:g}", lambda Q=Q: settled(Q).S, "{:.6f}", near(S, 5e-6)),
            Row(f"reference_plant, Q = {Q:g}, R = 1, error variance of y", f"{y:.6f}", lambda Q=Q: float(settled(Q).P[0, 0]), "{:.6f}", near(y, 2e-6)),
            Row(f"reference_plant, Q = {Q:g}, R = 1, readings until settled to 1e-6", "<= 60", lambda Q=Q: float(settled(Q).steps), "{:.0f}", between(1, 60)),
        ]  # fmt: skip
    alpha, beta, S = seed_004.constant_velocity_closed_form()
    rows += [
        Row("reference_plant, Q = 2.3, R = 1, tr P+", "3.344542", lambda: float(np.trace(settled(2.3).P)), "{:.6f}", near(3.344542, 1e-6)),
        Row("constant_velocity, gain on position", f"{alpha:.6f} (closed form)", lambda: float(constant_velocity().M[0]), "{:.6f}", near(alpha, 1e-6)),
        Row("constant_velocity, gain on velocity", f"{beta:.6f} (closed form)", lambda: float(constant_velocity().M[1]), "{:.6f}", near(beta, 1e-6)),
        Row("constant_velocity, innovation variance S", f"{S:.6f} (closed form)", lambda: constant_velocity().S, "{:.6f}", near(S, 1e-6)),
    ]  # fmt: skip
    return rows


SECTIONS: dict[str, Callable[[], list[Row]]] = {
    "000": rows_000,
    "offset": rows_offset,
    "001": rows_001,
    "004": rows_004,
}
"""Rows by the place they take on the page."""
