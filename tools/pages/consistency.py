"""Is a filter as sure of itself as it may be? NEES, NIS and whiteness over independent seeded runs, two-sided.

    NEES = e' P^-1 e at a fixed time; over M independent runs M mean(NEES) ~ chi2(M n)
    NIS  = the sum of the squared whitened innovations, white under the model: their sum ~ chi2(their number)
    whiteness: N sum over lags of rho(l)^2 ~ chi2(lags), rho over all whitened innovations in the order processed

Source: Bar-Shalom, Li and Kirubarajan 2001, section 5.4. NEES is taken at one time of each run and not averaged over
a run's times, which are serially correlated: the band of independent samples would be too narrow for such a mean.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import chi2

from fusiond.simulation.registry import simulate
from fusiond.simulation.tables import Reading, Simulation
from tools.pages.trials import Floats, Trial, configured, estimate, merged

SHARE = 0.95
LAGS = 10


@dataclass(frozen=True, slots=True)
class Check:
    """A statistic and the band a consistent filter keeps it in with probability SHARE."""

    value: float
    low: float
    high: float

    @property
    def inside(self) -> bool:
        """Whether the statistic is in its band, borders included."""
        return self.low <= self.value <= self.high


def mean_of_squares(total: float, degrees: int, each: int) -> Check:
    """Check of a sum ~ chi2(degrees), as a mean: total / (degrees / each), whose expectation is `each`."""
    tail = (1.0 - SHARE) / 2.0
    scale = each / degrees
    return Check(total * scale, chi2.ppf(tail, degrees) * scale, chi2.ppf(1.0 - tail, degrees) * scale)


@dataclass(frozen=True, slots=True)
class Ensemble:
    """M independent runs of one system through one configuration.

    nees: (M,) at the last stamp of each run.   states: their degrees of freedom.
    whitened: for each run and updating sensor, its whitened innovations, readings (k, channels) in order of time.
    stream: for each run, all whitened innovations in the order processed.
    """

    states: int
    nees: Floats
    whitened: Mapping[str, list[Floats]]
    stream: list[Floats]

    def nees_check(self) -> Check:
        """Mean NEES at the last stamp; expectation `states`."""
        return mean_of_squares(float(self.nees.sum()), self.states * self.nees.size, self.states)

    def nis_check(self, sensor: str) -> Check:
        """Mean NIS of one sensor over all its readings; expectation its number of channels."""
        runs = self.whitened[sensor]
        total = sum(float(np.sum(e**2)) for e in runs)
        return mean_of_squares(total, sum(e.size for e in runs), runs[0].shape[1])

    def whiteness_check(self) -> Check:
        """Box and Pierce's sum over LAGS lags, one-sided: only too much correlation is a fault."""
        return Check(whiteness(self.stream, LAGS), 0.0, float(chi2.ppf(SHARE, LAGS)))


def whiteness(runs: Iterable[Floats], lags: int) -> float:
    """N sum_l rho(l)^2 over several independent runs, the products of one run with itself only; ~ chi2(lags)."""
    series = list(runs)
    power = sum(float(e @ e) for e in series) / sum(e.size for e in series)
    total = 0.0
    for lag in range(1, lags + 1):
        products = sum(float(e[lag:] @ e[:-lag]) for e in series)
        count = sum(e.size - lag for e in series)
        total += (products / power) ** 2 / count
    return total


@dataclass(frozen=True, slots=True)
class Case:
    """A simulated system with its configuration, as shipped but for `changes`.

    Only the start is changed, to what the simulator draws its start from: a filter is consistent with respect to
    its own prior.   first: readings before the log, which make a prior that no diagonal can say.
    """

    name: str
    duration_s: float
    changes: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    first: tuple[Reading, ...] = ()
    config: str = ""


def _point(position_m: float) -> dict[str, Any]:
    """Seed 000's start: position and velocity exact, the offset drawn from N(-0.97, 1e-3)."""
    state = {"position_m": position_m, "velocity_m_s": 0.0, "acceleration_bias_m_s2": -0.97}
    return {
        "initial": {
            "state": state,
            "std": {"position_m": 0.0, "velocity_m_s": 0.0, "acceleration_bias_m_s2": 1e-3**0.5},
        }
    }


CASES = {
    "minicar": Case("minicar", 2.4, _point(0.0)),
    "birotor": Case("birotor", 2.4, _point(2.0)),
    "wall_robot": Case("wall_robot", 10.0),
    # x(0) ~ N(0, B Q B'): known exactly one step before, then one step of noise.
    "reference_plant": Case(
        "reference_plant",
        50.0,
        {"initial": {"std": {"x1": 0.0, "x2": 0.0, "x3": 0.0}}},
        first=(Reading(-1_000_000_000, "applied", (0.0,)),),
    ),
    "constant_velocity": Case("constant_velocity", 20.0),
    "planar": Case("planar", 10.0),
}


def ensemble(
    case: Case, simulations: Iterable[Simulation], changes: Mapping[str, Any] | None = None
) -> Ensemble:
    """Run simulated logs through a case's configuration, with further changes (a wrong R, say)."""
    engine = configured(case.config or case.name, merged(case.changes, changes or {})).engine()
    nees: list[float] = []
    whitened: dict[str, list[Floats]] = {}
    stream: list[Floats] = []
    for simulation in simulations:
        trial = estimate(engine, simulation, case.first)
        nees.append(float(trial.nees(trial.last_of_each_stamp()[-1:])[0]))
        for sensor, e in innovations(trial).items():
            whitened.setdefault(sensor, []).append(e)
        stream.append(in_order(trial))
    return Ensemble(len(engine.layout.states), np.array(nees), whitened, stream)


def innovations(trial: Trial) -> dict[str, Floats]:
    """(k, channels) whitened innovations of each updating sensor."""
    found: dict[str, Floats] = {}
    for sensor in trial.layout.sensors:
        rows = trial.of(sensor.name)
        if rows.size and trial.reports["dof"][rows[0]] > 0:
            found[sensor.name] = trial.reports["e"][rows, : trial.reports["dof"][rows[0]]]
    return found


def in_order(trial: Trial) -> Floats:
    """(k,) all whitened innovations in the order processed."""
    channel = np.arange(trial.reports["e"].shape[1])
    return np.asarray(trial.reports["e"][channel[None, :] < trial.reports["dof"][:, None]], dtype=np.float64)


def simulations(case: Case, runs: int, first_seed: int = 0) -> list[Simulation]:
    """Independent seeded runs of a case's system."""
    seeds = range(first_seed, first_seed + runs)
    return [simulate(case.name, seed, case.duration_s, **case.options) for seed in seeds]
