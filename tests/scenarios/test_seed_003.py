"""Seed 003: the square robot ends where the seed's does; encoders alone do worse, a gyro does far better."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.simulation import square_robot
from fusiond.simulation.registry import simulate
from fusiond.simulation.square_robot import Errors, Pace, Sensors
from tools.pages import seed_003
from tools.pages.seed_003 import CONFIGS, GYRO_RUNS, REACH_M, SEED_M
from tools.pages.trials import configured, estimate

DURATION_NS = 22_000_000_000
PERFECT = Errors(0.0, 0.0, (0.0, 0.0, 0.0), 0.0, 0.0)


@pytest.mark.parametrize("axis", [0, 1])
def test_the_fused_estimate_ends_as_far_off_as_the_seeds(axis):
    """23.5 cm in X, 32 cm in Y, root mean square of 100 runs, whose own spread is 7 % (20 % is three of them)."""
    fused = seed_003.rms(seed_003.paths("square_robot", GYRO_RUNS), axis)
    assert fused == pytest.approx(SEED_M[axis], rel=0.2)


def test_encoders_alone_do_worse():
    """The accelerometer takes off the slip of wheels that push and brake: less error in both axes on the same runs."""
    alone, fused = seed_003.alone(GYRO_RUNS), seed_003.paths("square_robot", GYRO_RUNS)
    for axis in range(2):
        assert seed_003.rms(alone, axis) > 1.03 * seed_003.rms(fused, axis)


@pytest.mark.parametrize("axis", [0, 1])
def test_with_a_gyro_95_of_100_runs_end_within_5_cm(axis):
    assert seed_003.p95(seed_003.paths("square_robot_gyro", GYRO_RUNS), axis) < REACH_M


@pytest.mark.parametrize("config", CONFIGS)
def test_what_is_reported_is_what_happens(config):
    """Both axes together: the reported standard deviation is within 20 % of the error's root mean square."""
    found = seed_003.paths(config, GYRO_RUNS)
    happened = np.hypot(*(seed_003.rms(found, axis) for axis in range(2)))
    said = np.hypot(*(seed_003.reported(found, axis) for axis in range(2)))
    assert said == pytest.approx(happened, rel=0.2)


def test_five_seconds_of_rest_tell_the_gyros_bias():
    """0.005 rad/s/sqrt(Hz) over 5 s: 0.0022 rad/s, and the estimate is within three of them."""
    trial = estimate(configured("square_robot_gyro").engine(), simulate("square_robot_gyro", 5))
    row = trial.of("gyro")[500]
    place = [slot.name for slot in trial.layout.errors].index("gyro_bias")
    std = trial.reports["std"][row, place]
    assert std == pytest.approx(0.005 / np.sqrt(5.0), rel=0.1)
    assert abs(trial.reports["x"][row, place] - Sensors().gyro_bias_rad_s) < 3.0 * std


# the robot


def test_a_robot_without_errors_is_where_its_encoders_say():
    """No error, no noise: integrated wheels end at the start, within what 10 ms sampling leaves."""
    run = simulate("square_robot", 0)
    readings, truth = square_robot.run(0, DURATION_NS, errors=PERFECT, sensors=Sensors(encoder_std_m_s=0.0))
    wheels = tuple(reading for reading in readings if reading.sensor == "encoders")
    path = seed_003.encoders_alone(type(run)("square_robot", 0, wheels, run.arrivals_ns, truth))
    assert np.hypot(*path.end_m) < 1e-4
    assert np.hypot(path.x_m - truth.column("x"), path.y_m - truth.column("y")).max() < 0.001


def test_the_motion_is_the_square_and_consistent_with_itself():
    """Speed and yaw rate are the derivatives of position and yaw; it ends at rest where it began."""
    driven = square_robot.motion(Pace(), DURATION_NS)
    way = np.hypot(np.diff(driven.x_m), np.diff(driven.y_m)) / 1e-3
    middle = 0.5 * (driven.speed_m_s[1:] + driven.speed_m_s[:-1])
    assert way == pytest.approx(middle, abs=1e-9)
    turned = np.diff(driven.yaw_rad) / 1e-3
    assert turned == pytest.approx(0.5 * (driven.yaw_rate_rad_s[1:] + driven.yaw_rate_rad_s[:-1]), abs=1e-9)
    assert way.sum() * 1e-3 == pytest.approx(12.0)
    assert driven.yaw_rad[-1] == pytest.approx(-np.pi, abs=1e-9)
    end = [driven.x_m[-1], driven.y_m[-1], driven.speed_m_s[-1], driven.yaw_rate_rad_s[-1]]
    assert end == pytest.approx([0.0] * 4, abs=1e-9)
    assert Pace().end_s == pytest.approx(21.31)


def test_a_scrubbing_turn_turns_the_wheels_more_than_the_body():
    """5 % at corner 1 alone: the wheels say 90 degrees / 0.95 there, and 90 degrees at the others."""
    driven = square_robot.motion(Pace(), DURATION_NS)
    wrong = square_robot._wrong(3, driven, Errors(0.0, 0.0, (0.05, 0.0, 0.0), 0.0, 0.0))
    left, right = square_robot._wheels(driven, wrong, Sensors())
    share = wrong["turn_slip"][driven.phase == 5][0]
    for first, scrubbed in ((4, share), (10, 0.0), (16, 0.0)):
        rows = (driven.phase >= first) & (driven.phase < first + 3)
        said = np.sum((right - left)[rows]) / 0.4 * 1e-3
        assert said == pytest.approx(-0.5 * np.pi / (1.0 - scrubbed), rel=1e-3)


def test_wheels_that_push_run_ahead_and_wheels_that_brake_lag():
    driven = square_robot.motion(Pace(), DURATION_NS)
    wrong = square_robot._wrong(3, driven, Errors(0.0, 0.0, (0.0, 0.0, 0.0), 0.1, 0.0))
    left, _ = square_robot._wheels(driven, wrong, Sensors())
    ahead = left - driven.speed_m_s
    straight = np.abs(driven.yaw_rate_rad_s) < 1e-12
    assert (ahead[straight & (driven.acceleration_m_s2 > 0.0)] > 0.0).all()
    assert (ahead[straight & (driven.acceleration_m_s2 < 0.0)] < 0.0).all()
    assert np.abs(ahead[straight & (driven.acceleration_m_s2 == 0.0)]).max() < 1e-12
