"""A Jackal driven by hand, watched: nobody is blamed for what its wheels do; a gyro that lies is named."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.types import Health
from tests.recordings.watched import since_s, watched

pytestmark = pytest.mark.recordings("jackal")


@pytest.fixture
def jackal(log_of):
    return watched("jackal", log_of("jackal"), {})


def test_a_minute_of_driving_is_no_fault(jackal):
    """61 s of starts and stops: no sensor is called faulty, the model is not blamed; suspected somebody may be."""
    reports = jackal.run()
    assert jackal.named(reports) == set()
    assert not reports["model"].any()


def test_one_bad_sample_changes_no_flag(jackal):
    """A spike of 2 rad/s in one reading of the gyro: the same flags as in the clean run."""
    clean, spiked = jackal.run(), jackal.run("imu.1.spike=2@30+0.015")
    assert np.array_equal(clean["health"], spiked["health"])
    assert np.array_equal(clean["fault"], spiked["fault"])


def test_a_gyro_that_lies_is_named_and_believed_again(jackal):
    """0.5 rad/s too much from 30 s to 40 s: found within ten readings, its size within 3 std, over within ten."""
    reports = jackal.run("imu.1.bias=0.5@30+10")
    assert jackal.named(reports) == {("imu", "bias")}
    imu, t_s = jackal.sensor("imu"), since_s(reports)
    health = reports["health"][:, imu]
    found = t_s[health == Health.FAULTY]
    assert found[0] < 30.2
    assert found[-1] < 40.2
    last = reports[health == Health.FAULTY][-1]
    assert last["fault_channel"][imu] == 1
    assert abs(last["fault_size"][imu] - 0.5) < 3.0 * last["fault_std"][imu]
