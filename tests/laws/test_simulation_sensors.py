"""The simulated sensors have the noise they claim, and no more."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2, norm

from fusiond.simulation import sensors
from fusiond.simulation.registry import simulate
from fusiond.simulation.tables import Simulation

ONE_S = 1_000_000_000
WORST_MISS = 1e-3
"""Two-sided probability of every interval below; the seeds are fixed, so a test that passes always passes."""


def assert_variance(samples: Any, variance: float, mean: float = 0.0) -> None:
    """The samples' mean and variance lie in the two-sided intervals of N(mean, variance)."""
    samples = np.asarray(samples)
    assert abs(samples.mean() - mean) <= norm.ppf(1.0 - WORST_MISS / 2.0) * np.sqrt(variance / samples.size)
    low, high = chi2.ppf([WORST_MISS / 2.0, 1.0 - WORST_MISS / 2.0], samples.size)
    assert low <= np.sum((samples - mean) ** 2) / variance <= high


def assert_white(samples: Any) -> None:
    """No correlation between neighbours, two-sided."""
    centred = np.asarray(samples) - np.mean(samples)
    correlation = np.sum(centred[1:] * centred[:-1]) / np.sum(centred**2)
    assert abs(correlation) <= norm.ppf(1.0 - WORST_MISS / 2.0) / np.sqrt(centred.size)


def wrapped(angle_rad: Any) -> Any:
    return np.arctan2(np.sin(angle_rad), np.cos(angle_rad))


def planar_errors(run: Simulation) -> dict[str, tuple[Any, float]]:
    """Per sensor channel: reading minus what an independent formula makes of the truth, and its variance."""

    def of(name: str) -> tuple[Any, dict[str, Any]]:
        t_ns, z = run.of(name)
        rows = np.searchsorted(run.truth.t_ns, t_ns)
        return z, {column: run.truth.column(column)[rows] for column in run.truth.names}

    errors: dict[str, tuple[Any, float]] = {}
    z, x = of("gps")
    errors["gps.x"], errors["gps.y"] = (z[:, 0] - x["x"], 0.25), (z[:, 1] - x["y"], 0.25)
    z, x = of("wheel_speed")
    errors["wheel_speed"] = (z[:, 0] - x["speed"], 0.01)
    z, x = of("gyro")
    errors["gyro"] = (z[:, 0] - x["yaw_rate"] - x["gyro_bias"], 1e-4)
    z, x = of("heading")
    errors["heading"] = (wrapped(z[:, 0] - x["yaw"]), 4e-4)
    assert np.all(np.abs(z[:, 0]) <= np.pi)
    z, x = of("beacon")
    at = np.array(sensors.BEACONS_M)[z[:, 1].astype(int)]
    errors["beacon"] = (z[:, 0] - np.linalg.norm(np.column_stack((x["x"], x["y"])) - at, axis=1), 0.04)
    z, x = of("radar")
    bearing = np.angle(x["x"] + 1j * x["y"])
    errors["radar.rho"] = (z[:, 0] - np.abs(x["x"] + 1j * x["y"]), 0.09)
    errors["radar.phi"] = (wrapped(z[:, 1] - bearing), 9e-4)
    errors["radar.rho_dot"] = (z[:, 2] - x["vx"] * np.cos(bearing) - x["vy"] * np.sin(bearing), 0.09)
    return errors


def test_every_planar_sensor_has_its_variance_and_no_memory() -> None:
    """Bias, variance and whiteness of nine channels over 300 s, two-sided; no two channels go together."""
    errors = planar_errors(simulate("planar", 7, 300.0))
    assert len(errors) == 9
    for error, variance in errors.values():
        assert_variance(error, variance)
        assert_white(error)
    ten_hertz = np.array([errors[name][0] for name in ("heading", "beacon", "radar.rho", "radar.phi")])
    across = np.corrcoef(ten_hertz)[np.triu_indices(4, 1)]
    assert np.abs(across).max() <= norm.ppf(1.0 - WORST_MISS / 12.0) / np.sqrt(ten_hertz.shape[1])


def test_the_beacons_are_asked_in_turn() -> None:
    indices = simulate("planar", 0, 2.0, aboard=("beacon",)).of("beacon")[1][:, 1]
    np.testing.assert_array_equal(indices, np.arange(21) % 4)


@pytest.mark.parametrize("name", ["minicar", "birotor"])
def test_accelerometer_and_ultrasonic_have_the_seeds_variances(name: str) -> None:
    """1e-4 each; the accelerometer around its bias, the kinematic acceleration and no gravity in it."""
    run = simulate(name, 4, 20.0)
    t_ns, z = run.of("accelerometer")
    assert t_ns[0] == 1_000_000
    assert set(np.diff(t_ns)) == {1_000_000}
    rows = np.searchsorted(run.truth.t_ns, t_ns)
    v = run.truth.column("velocity")
    error = z[:, 0] - (v[rows] - v[rows - 1]) / 0.001 - run.truth.column("acceleration_bias")[rows]
    assert_variance(error, 1e-4)
    assert_white(error)
    t_ns, z = run.of("ultrasonic")
    assert set(np.diff(t_ns)) == {30_000_000}
    assert_variance(z[:, 0] - run.truth.column("position")[np.searchsorted(run.truth.t_ns, t_ns)], 1e-4)


def test_the_accelerometers_bias_is_drawn_once_per_run() -> None:
    """Mean -0.97 and variance 1e-3 over 2000 seeds, two-sided."""
    assert_variance([sensors.accelerometer(seed).bias[0] for seed in range(2000)], 1e-3, mean=-0.97)


def test_wall_robot_and_linear_plants_have_their_variances() -> None:
    """Standard deviations 0.2 and 0.03 of the seed; R = 1 and 4 as asked, uncorrelated with each other."""
    runs = [simulate("wall_robot", seed) for seed in range(40)]
    assert_variance(np.concatenate([r.of("speed")[1][:, 0] - r.truth.column("velocity") for r in runs]), 0.04)
    assert_variance(np.concatenate([r.of("range")[1][:, 0] - r.truth.column("position") for r in runs]), 9e-4)
    run = simulate("reference_plant", 0, 5000.0, R=(1.0, 4.0))
    noise = np.array([run.of(name)[1][:, 0] - run.truth.column("x1") for name in ("y1", "y2")])
    assert_variance(noise[0], 1.0)
    assert_variance(noise[1], 4.0)
    assert abs(np.corrcoef(noise)[0, 1]) <= norm.ppf(1.0 - WORST_MISS / 2.0) / np.sqrt(5001)
    np.testing.assert_array_equal(run.of("applied")[1][:, 0], np.sin(np.arange(5001) / 5.0))
