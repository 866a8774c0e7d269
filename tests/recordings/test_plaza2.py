"""A robot mower located by odometry and ranges that all read 6.9 % long."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from fusiond.types import Verdict
from tools.pages.recorded import errors, import_from, recorded, rms_length
from tools.pages.recording_ranges_rows import (
    HEADINGS_RAD,
    REFERENCE_M,
    RMSE_REACH_M,
    SCALE,
    SCALE_REACH,
    ratios,
    turned,
    without_ranges,
)

pytestmark = pytest.mark.recordings("plaza2_uwb_mower")
LOGS = {}


@pytest.fixture
def mower(recording, tmp_path_factory):
    """The recording with one of its configurations, imported once."""
    folder = recording("plaza2_uwb_mower")
    if "log" not in LOGS:
        LOGS["log"] = import_from(folder, "plaza2", tmp_path_factory.mktemp("plaza2"))
    return lambda name: recorded(name, LOGS["log"])


def test_with_the_scale_as_a_state_the_mower_is_found(mower):
    """0.45 m RMSE of the position at most, and the scale of the ranges 1.069 within 0.003."""
    run = mower("plaza2_scale")
    summary = run.run()
    assert summary.refused == {}
    assert np.hypot(summary.rmse["x"], summary.rmse["y"]) <= RMSE_REACH_M
    assert summary.final["state"]["range_scale"] == pytest.approx(SCALE, abs=SCALE_REACH)
    assert set(run.reports["verdict"]) == {Verdict.USED}


def test_its_covariance_covers_its_errors(mower):
    """NEES of the pose, 3 expected, below the 95 % bound of errors that stay for 10 s; the scale within three of its
    deviations of what the ranges are over the true distances.
    """
    run = mower("plaza2_scale")
    summary = run.run()
    low, high = chi2.ppf([0.025, 0.975], 3 * 40) / 40
    assert low < summary.nees_mean < high
    scale, std = summary.final["state"]["range_scale"], summary.final["std"]["range_scale"]
    assert abs(scale - np.mean(list(ratios(run).values()))) < 3.0 * std


@pytest.mark.parametrize("by_rad", HEADINGS_RAD)
def test_the_heading_is_found_from_any_start(mower, by_rad):
    """GIVEN a heading wrong by up to half a turn, THEN the position is within reach after a minute."""
    run = mower("plaza2_scale")
    assert rms_length(errors(run, turned(run, by_rad), ["x", "y"], 60.0)[1]) <= RMSE_REACH_M


def test_taken_as_they_come_the_ranges_lead_metres_away_and_say_so(mower):
    """What there is to diagnose: 4 m of RMSE, and innovations eighteen times as large as they may be."""
    summary = mower("plaza2").run()
    assert np.hypot(summary.rmse["x"], summary.rmse["y"]) == pytest.approx(REFERENCE_M["raw"], abs=0.3)
    assert summary.sensors["uwb"].nis_mean > 10.0


def test_all_beacons_share_one_scale(mower):
    """Each reads 6.9 % to 7.0 % long, none apart from the others: one fault of the group."""
    found = ratios(mower("plaza2"))
    assert set(found) == {0, 1, 5, 6}
    assert all(ratio == pytest.approx(1.0695, abs=0.0015) for ratio in found.values())


def test_odometry_alone_drifts_as_far_as_another_filter_found(mower):
    """31.6 m RMSE: gains over uneven intervals became speeds and turned back into the same way."""
    assert rms_length(without_ranges(mower("plaza2"))) == pytest.approx(REFERENCE_M["odometry"], abs=0.3)
