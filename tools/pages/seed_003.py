"""Seed 003: a robot goes round a square on wheels that slip. Encoders alone, with an accelerometer, and with a gyro."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from fusiond.simulation.registry import simulate
from fusiond.simulation.square_robot import SAMPLE_NS, Sensors
from fusiond.simulation.tables import Simulation
from tools.pages.seed_003_bound import Score, score
from tools.pages.seed_row import Row, near
from tools.pages.trials import Floats, configured, records

RUNS = 1000
"""Over which the end points are taken: a root mean square of so many is sure to 2.2 %."""
GYRO_RUNS = 100
"""The runs that are promised with a gyro: seeds 0 to 99."""
BOUND_RUNS = 60
CONFIGS = ("square_robot", "square_robot_gyro")
SEED_M = (0.235, 0.32)
"""How far off in X and Y the seed's fused estimate ends; for encoders alone it gives no figure."""
REACH_M = 0.05


@dataclass(frozen=True, slots=True)
class Path:
    """One run: estimated x, y after every 10 ms, and the standard deviations (x, y) reported at the end."""

    x_m: Floats
    y_m: Floats
    end_std_m: Floats

    @property
    def end_m(self) -> tuple[float, float]:
        """How far off it ends: the robot is back at the origin."""
        return float(self.x_m[-1]), float(self.y_m[-1])


def encoders_alone(run: Simulation) -> Path:
    """The wheels' readings integrated, and nothing else: the seed's first round."""
    _, wheels = run.of("encoders")
    dt_s, nothing = SAMPLE_NS * 1e-9, np.zeros(2)
    rate = (wheels[:, 1] - wheels[:, 0]) / Sensors().track_m
    yaw = 0.5 * np.pi + np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * dt_s))
    speed = wheels.mean(axis=1)
    way = 0.5 * (speed[1:] + speed[:-1]) * dt_s
    middle = 0.5 * (yaw[1:] + yaw[:-1])
    x, y = (np.append(0.0, np.cumsum(way * part)) for part in (np.cos(middle), np.sin(middle)))
    return Path(x, y, nothing)


@cache
def paths(config: str, runs: int) -> tuple[Path, ...]:
    """The engine on seeds 0, 1, ...; the same errors with and without a gyro."""
    engine = configured(config).engine()
    found = []
    for seed in range(runs):
        engine.reset()
        given = records(engine.layout, simulate(config, seed).readings)
        reports = engine.process(given)
        last = np.flatnonzero(np.append(np.diff(reports["t_ns"]) != 0, True))
        x = reports["x"][last]
        found.append(Path(x[:, 0].copy(), x[:, 1].copy(), reports["std"][last[-1], :2].copy()))
    return tuple(found)


@cache
def alone(runs: int) -> tuple[Path, ...]:
    """Encoders alone on the same runs."""
    return tuple(encoders_alone(simulate("square_robot", seed)) for seed in range(runs))


@cache
def bounded(config: str) -> Score:
    """How near the filter comes to the bound on its own model."""
    assembly = configured(config)
    return score(assembly, assembly.engine(), BOUND_RUNS)


def ends(found: tuple[Path, ...]) -> Floats:
    """(runs, 2) end points, m."""
    return np.array([path.end_m for path in found])


def rms(found: tuple[Path, ...], axis: int) -> float:
    """Root mean square of the end points, m."""
    return float(np.sqrt(np.mean(ends(found)[:, axis] ** 2)))


def p95(found: tuple[Path, ...], axis: int) -> float:
    """The distance that 95 of 100 end points stay within, m."""
    return float(np.percentile(np.abs(ends(found)[:, axis]), 95.0))


def reported(found: tuple[Path, ...], axis: int) -> float:
    """Root mean square of the standard deviations reported at the end, m."""
    return float(np.sqrt(np.mean([path.end_std_m[axis] ** 2 for path in found])))


def rows() -> list[Row]:
    """The figures of the page."""
    return [*_end_rows(), *_gyro_rows(), *_bound_rows()]


def _end_rows() -> list[Row]:
    def fused() -> tuple[Path, ...]:
        return paths("square_robot", RUNS)

    found = []
    for axis, name in enumerate("XY"):
        said = f"{SEED_M[axis]:g} m, the seed's; the errors are chosen for it"
        found += [
            Row(f"encoders alone, end in {name}, RMS", "none stated", _of(lambda a: rms(alone(RUNS), a), axis),
                "{:.3f} m", lambda _: True, cheap=False),
            Row(f"fused, end in {name}, RMS", said, _of(lambda a: rms(fused(), a), axis), "{:.3f} m",
                near(SEED_M[axis], 0.05), cheap=False),
            Row(f"fused, standard deviation reported in {name}", "none stated",
                _of(lambda a: reported(fused(), a), axis), "{:.3f} m", lambda _: True, cheap=False),
        ]  # fmt: skip
    return found


def _gyro_rows() -> list[Row]:
    def with_gyro() -> tuple[Path, ...]:
        return paths("square_robot_gyro", GYRO_RUNS)

    found = []
    for axis, name in enumerate("XY"):
        found += [
            Row(f"with a gyro, end in {name}, 95 of 100 runs within", "< 0.05 m",
                _of(lambda a: p95(with_gyro(), a), axis), "{:.4f} m", lambda value: value < REACH_M),
            Row(f"with a gyro, standard deviation reported in {name}", "none stated",
                _of(lambda a: reported(with_gyro(), a), axis), "{:.4f} m", lambda _: True),
        ]  # fmt: skip
    return found


def _bound_rows() -> list[Row]:
    found = []
    for config in CONFIGS:
        for name in ("x", "y", "yaw", "speed"):
            found.append(
                Row(f"{config}, own model, {name}, RMSE / bound", "<= 1.05", _ratio(config, name), "{:.3f}",
                    lambda value: value <= 1.05, cheap=False)
            )  # fmt: skip
        found.append(
            Row(f"{config}, own model, worst of all states, RMSE / bound", "<= 1.05", _worst(config), "{:.3f}",
                lambda value: value <= 1.05, cheap=False)
        )  # fmt: skip
        found.append(
            Row(f"{config}, own model, NEES over its degrees of freedom", "1 +- 0.11 (95 %)", _nees(config),
                "{:.3f}", near(1.0, 0.11), cheap=False)
        )  # fmt: skip
    return found


def _of(measure: Callable[[int], float], axis: int) -> Callable[[], float]:
    return lambda: measure(axis)


def _ratio(config: str, name: str) -> Callable[[], float]:
    return lambda: bounded(config).of(name)


def _worst(config: str) -> Callable[[], float]:
    return lambda: float(bounded(config).paired.max())


def _nees(config: str) -> Callable[[], float]:
    return lambda: float(np.mean(bounded(config).nees)) / len(bounded(config).names)
