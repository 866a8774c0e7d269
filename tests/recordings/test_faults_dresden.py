"""A drive through Dresden, watched: a receiver's multipath is no fault, a jump of 30 m and silence are."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.types import Health
from tests.recordings.watched import since_s, watched

pytestmark = pytest.mark.recordings("dresden_car")


@pytest.fixture
def dresden(log_of):
    return watched("dresden_car", log_of("dresden_car"), {})


def test_a_drive_through_a_city_is_no_fault(dresden):
    """216 s with multipath, standstill and repeated fixes: everything stays healthy."""
    reports = dresden.run()
    assert not reports["health"].any()
    assert not reports["model"].any()


def test_one_bad_sample_changes_no_flag(dresden):
    """A spike of 3 rad/s in one reading of the gyro: the same flags as in the clean run."""
    clean, spiked = dresden.run(), dresden.run("yaw_rate.spike=3@100+0.01")
    assert np.array_equal(clean["health"], spiked["health"])


def test_a_jump_of_the_receiver_is_named_sized_and_over_in_time(dresden):
    """30 m too much in x and y from 100 s to 120 s: the receiver, a bias, 30 m; healthy by 121 s."""
    reports = dresden.run("gps.bias=30@100+20")
    assert dresden.named(reports) == {("gps", "bias")}
    gps, t_s = dresden.sensor("gps"), since_s(reports)
    faulty = reports["health"][:, gps] == Health.FAULTY
    assert 100.0 <= t_s[faulty][0] < 101.0
    assert t_s[faulty][-1] < 121.0
    last = reports[faulty][-1]
    assert abs(last["fault_size"][gps] - 30.0) < 3.0 * last["fault_std"][gps]


def test_a_receiver_that_stops_is_silent_and_no_one_else_is_blamed(dresden):
    """No rows from 100 s to 120 s: silent within 0.2 s, and healthy at the end."""
    reports = dresden.run("gps.broken@100+20")
    gps, t_s = dresden.sensor("gps"), since_s(reports)
    silent = reports["health"][:, gps] == Health.SILENT
    assert t_s[silent][0] < 100.2
    assert set(np.flatnonzero(reports["health"].any(axis=0))) == {gps}
    assert reports["health"][-1, gps] == Health.HEALTHY


def test_a_gyro_that_lies_is_named_and_not_the_receiver(dresden):
    """0.4 rad/s too much from 100 s to 120 s: the gyro and nobody else, within 0.5 s, over by 122 s.

    Of 0.3 rad/s the first reading alone tells, not quite enough to say whether it was a spike.
    """
    reports = dresden.run("yaw_rate.bias=0.4@100+20")
    assert dresden.named(reports) == {("yaw_rate", "bias")}
    gyro, t_s = dresden.sensor("yaw_rate"), since_s(reports)
    faulty = reports["health"][:, gyro] == Health.FAULTY
    assert 100.0 <= t_s[faulty][0] < 100.5
    assert t_s[faulty][-1] < 122.0
    last = reports[faulty][-1]
    assert abs(last["fault_size"][gyro] - 0.4) < 3.0 * last["fault_std"][gyro]
