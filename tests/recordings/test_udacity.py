"""A simulated pedestrian seen by laser and radar: exact truth, and a course's limits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from tools.pages.recorded import recorded

pytestmark = pytest.mark.recordings("udacity_laser_radar")
NAMES = ("x", "y", "vx", "vy")
LIMITS = (0.09, 0.10, 0.40, 0.30)
"""The course's for an unscented filter; m and m/s."""
REFERENCE = (0.0748, 0.0743, 0.2898, 0.2495)
"""A plain extended filter with constant velocity, sigma_a^2 = 9."""


@pytest.fixture
def run(log_of):
    return lambda config: recorded(config, log_of("udacity_laser_radar"))


@pytest.mark.parametrize("config", ["udacity_laser_radar", "udacity_laser_radar_robot"])
def test_errors_stay_within_the_limits_of_the_course(run, config):
    """RMSE of x, y, vx, vy over all 500 readings: 0.09 m, 0.10 m, 0.40 m/s, 0.30 m/s."""
    summary = run(config).run()
    assert summary.compared == 500
    assert summary.refused == {}
    for name, limit in zip(NAMES, LIMITS, strict=True):
        assert summary.rmse[name] <= limit, name


def test_constant_velocity_is_no_worse_than_the_reference(run):
    """At most 1.02 times the errors of an independent filter with the same model."""
    rmse = run("udacity_laser_radar").run().rmse
    for name, reference in zip(NAMES, REFERENCE, strict=True):
        assert rmse[name] <= 1.02 * reference, name


def test_the_robot_fits_better_than_the_point(run):
    """The motion turns: the model that can, errs less in every number, by a third in velocity."""
    point, robot = run("udacity_laser_radar").run().rmse, run("udacity_laser_radar_robot").run().rmse
    assert all(robot[name] < point[name] for name in NAMES)
    assert robot["vx"] < 0.67 * point["vx"]
    assert robot["vy"] < 0.70 * point["vy"]


@pytest.mark.parametrize(("sensor", "dof"), [("laser", 2), ("radar", 3)])
def test_the_robots_innovations_are_those_it_expects(run, sensor, dof):
    """NIS of 250 readings a sensor, two-sided 95 %: the noise is what the simulator says, the motion close to it."""
    recording = run("udacity_laser_radar_robot")
    nis = recording.reports["nis"][recording.used(sensor)]
    low, high = chi2.ppf([0.025, 0.975], dof * len(nis)) / len(nis)
    assert low < np.mean(nis) < high


def test_the_robots_covariance_is_honest(run):
    """NEES of the position, 2 expected; errors are correlated over about a second, hence 25 free ones in 25 s."""
    summary = run("udacity_laser_radar_robot").run()
    assert summary.nees_dof == 2
    low, high = chi2.ppf([0.025, 0.975], 2 * 25) / 25
    assert low < summary.nees_mean < high


def test_the_points_covariance_is_not_too_small(run):
    """Constant velocity with the course's noise is cautious: NEES of four states below the upper 95 % bound."""
    summary = run("udacity_laser_radar").run()
    assert summary.nees_dof == 4
    assert summary.nees_mean < chi2.ppf(0.975, 4 * 25) / 25
