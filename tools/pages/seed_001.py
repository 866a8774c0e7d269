"""Seed 001: a robot before a wall. Closed form, Monte Carlo, and the printed program's mistake."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from fusiond.simulation.registry import simulate
from fusiond.simulation.tables import Simulation
from tools.pages.seed_row import Row, between, near
from tools.pages.trials import Floats, Trial, configured, estimate

Q_M2 = (0.2 * 0.1) ** 2
R_M2 = 0.03**2
RUNS = 400


@dataclass(frozen=True, slots=True)
class Steady:
    """Where F = H = 1 settles: gain, and variance before and after a range, m^2."""

    gain: float
    P_before: float
    P_after: float


def closed_form() -> Steady:
    """P- = (Q + sqrt(Q^2 + 4 Q R)) / 2, P+ = P- - Q, K = P+ / R."""
    before = (Q_M2 + (Q_M2**2 + 4.0 * Q_M2 * R_M2) ** 0.5) / 2.0
    return Steady((before - Q_M2) / R_M2, before, before - Q_M2)


@cache
def simulations(runs: int = RUNS) -> tuple[Simulation, ...]:
    """Seeded runs of the seed's trajectory."""
    return tuple(simulate("wall_robot", seed) for seed in range(runs))


@dataclass(frozen=True, slots=True)
class Figures:
    """What many runs of one configuration come to. error, nees: (runs, 100), without the exact start."""

    error: Floats
    nees: Floats
    last: Trial

    @property
    def rmse_m(self) -> float:
        """Root mean square error over all runs and steps."""
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def nees_mean(self) -> float:
        """Mean squared error over its reported variance; 1 where the filter is honest."""
        return float(np.mean(self.nees))

    @property
    def within_one_sigma(self) -> float:
        """Share of errors inside the one standard deviation that the seed draws."""
        return float(np.mean(self.nees <= 1.0))

    @property
    def steady(self) -> Steady:
        """Gain and variances at the end of a run, as the engine has them."""
        row = self.last.of("range")[-1]
        after = float(self.last.P[row, 0, 0])
        before = float(self.last.reports["S"][row, 0]) - R_M2
        return Steady(after / R_M2, before, after)


@cache
def figures(config: str, runs: int = RUNS) -> Figures:
    """Run every simulation through configs/CONFIG.toml."""
    engine = configured(config).engine()
    trials = [estimate(engine, simulation) for simulation in simulations(runs)]
    rows = trials[0].of("range")[1:]
    return Figures(
        np.array([trial.error[rows, 0] for trial in trials]),
        np.array([trial.nees(rows) for trial in trials]),
        trials[-1],
    )


def raw_rmse_m() -> float:
    """Root mean square error of the range finder alone, over the same runs."""
    squares = [
        np.mean((run.of("range")[1][:, 0] - run.truth.column("position")) ** 2) for run in simulations()
    ]
    return float(np.sqrt(np.mean(squares)))


def rows() -> list[Row]:
    """The figures of the page."""
    exact = closed_form()

    def corrected() -> Figures:
        return figures("wall_robot")

    def printed() -> Figures:
        return figures("wall_robot_as_written")

    gain, after = f"{exact.gain:.5f} (closed form)", f"{exact.P_after:.4e} m^2 (closed form)"
    limit, sure = "0.0208 m (root of P+) within 2 %", "1.19: more sure of itself than it may be"
    return [
        Row("gain K", gain, lambda: corrected().steady.gain, "{:.5f}", near(exact.gain, 1e-6)),
        Row("P+", after, lambda: corrected().steady.P_after, "{:.4e} m^2", near(exact.P_after, 1e-6)),
        Row("range finder alone, RMSE", "0.0300 m", raw_rmse_m, "{:.5f} m", near(0.03, 0.02)),
        Row("corrected, RMSE", limit, lambda: corrected().rmse_m, "{:.5f} m", near(exact.P_after**0.5, 0.02)),
        Row(
            "corrected, NEES",
            "1; 1.01 found before",
            lambda: corrected().nees_mean,
            "{:.3f}",
            near(1.0, 0.03),
        ),
        Row("as printed, RMSE", "0.02269 m", lambda: printed().rmse_m, "{:.5f} m", near(0.02269, 0.02)),
        Row("as printed, NEES", sure, lambda: printed().nees_mean, "{:.3f}", near(1.19, 0.03)),
        Row(
            "corrected, errors inside the plotted +-1 sigma",
            "68.3 %",
            lambda: 100.0 * corrected().within_one_sigma,
            "{:.1f} %",
            between(67.0, 69.5),
        ),
    ]
