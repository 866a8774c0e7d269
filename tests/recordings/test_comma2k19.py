"""A minute on the highway with a phone: a gyro with its bias in it, and fixes that come with stamps 0.1 s late."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from fusiond.assembly.assembly import assemble
from fusiond.types import Kind, Verdict
from tools.pages.recorded import import_from, recorded
from tools.pages.recording_strapdown_rows import (
    BIAS_REACH_RAD_S,
    HIGHWAY_REACH_M,
    bias_errors,
    delayed,
    rms_of,
    settled_s,
)
from tools.scoreboard.recordings import run, watched

pytestmark = pytest.mark.recordings("comma2k19")
RUNS = {}


@pytest.fixture
def highway(recording, tmp_path_factory):
    """The recording and its reports, run once."""
    folder = recording("comma2k19")
    if "highway" not in RUNS:
        log = import_from(folder, "comma2k19", tmp_path_factory.mktemp("comma2k19"))
        RUNS["highway"] = recorded("comma2k19", log)
    return RUNS["highway"]


def test_the_gyros_bias_is_found_on_every_axis(highway):
    """Within 0.002 rad/s of the phone's own, from 0.07 rad/s away, in ten seconds and for good."""
    assert np.all(np.abs(bias_errors(highway)[-1]) <= BIAS_REACH_RAD_S)
    assert settled_s(highway) < 10.0
    assert np.abs(bias_errors(highway)[0]).max() > 0.06


def test_the_position_is_that_of_the_pose(highway):
    """0.6 m horizontal RMS at most; the position's own covariance is not too small by more than half."""
    assert rms_of(highway) <= HIGHWAY_REACH_M
    summary = highway.run()
    assert summary.nees_dof == 2
    assert summary.nees_mean < 2.0 * 1.5


def test_every_reading_is_used(highway):
    """Late stamps are put in their place; nothing is refused."""
    assert set(highway.reports["verdict"]) == {Verdict.USED}
    assert highway.run().refused == {}


def test_the_configured_delay_is_that_of_the_fixes(highway):
    """GIVEN a delay 0.05 s shorter or longer, or none, THEN the position is further off than 0.6 m."""
    assert rms_of(delayed(highway, 0.0)) > 2.0 * HIGHWAY_REACH_M
    assert rms_of(delayed(highway, 0.05)) > HIGHWAY_REACH_M
    assert rms_of(delayed(highway, 0.15)) > HIGHWAY_REACH_M


def test_a_delay_that_is_not_configured_is_told(highway):
    """GIVEN stamps 0.10 s late and no word of it, THEN the receiver's speed is called late, and nothing else is."""
    told = run(watched("comma2k19", unsaid="delay_s"), highway.readings)
    assert set(told.names()) == {("gnss_course", Kind.DELAY.label)}
    assert told.sizes("gnss_course", Kind.DELAY)[-1] == pytest.approx(0.10, abs=0.02)


def test_with_its_delay_configured_the_receiver_is_not_late(highway):
    """GIVEN that delay, THEN nobody is called faulty in this minute."""
    assert not run(watched("comma2k19"), highway.readings).names()


@pytest.mark.parametrize("yaw_rad", [-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])
def test_the_heading_is_found_from_any_start(highway, yaw_rad):
    """GIVEN a heading wrong by up to half a turn, THEN all that is asked of it is reached all the same."""
    config = highway.assembly.config
    state = {"qw": math.cos(0.5 * yaw_rad), "qz": math.sin(0.5 * yaw_rad)}
    initial = config.initial.model_copy(update={"state": state})
    other = dataclasses.replace(highway, assembly=assemble(config.model_copy(update={"initial": initial})))
    assert rms_of(other) <= HIGHWAY_REACH_M
    assert np.all(np.abs(bias_errors(other)[-1]) <= BIAS_REACH_RAD_S)


def test_without_the_receiver_it_is_lost(highway):
    """The figure is the fusion's: IMU and wheels alone find no heading, and stay more than 10 m off, RMS."""
    numbers = [highway.assembly.layout.numbers[name] for name in ("gnss_position", "gnss_course")]
    summary = highway.run(lambda chunk: ~np.isin(chunk["sensor"], numbers))
    assert np.hypot(summary.rmse["x"], summary.rmse["y"]) > 10.0


def test_the_truth_is_north_and_east_of_the_first_fix(highway):
    """Earth-fixed places on the plane of the fixes: the pose and the delayed fixes are 0.55 m apart, RMS."""
    fixes = highway.readings[highway.of("gnss_position")]
    true, covered = highway.truth.at(fixes["t_ns"] - 100_000_000)
    apart = (fixes["z"][:, :2] - true)[covered]
    assert np.sqrt(np.mean(np.sum(apart**2, axis=1))) == pytest.approx(0.55, abs=0.01)
