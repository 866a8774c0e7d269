"""Recordings smoothed: nearer to the truth, or to fixes that were withheld; docs/smoothing.md says how much."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.pages.recorded import recorded
from tools.pages.smoothing import smoothed_run
from tools.pages.smoothing_page import WALKERS
from tools.pages.smoothing_rows import recordings_table, walker_errors, withheld_m

PAGE = Path(__file__).resolve().parents[2] / "docs" / "smoothing.md"


@pytest.mark.recordings("udacity_laser_radar")
@pytest.mark.parametrize("config", WALKERS)
def test_the_walk_is_known_better_from_its_end(log_of, config):
    """Every RMSE at most 0.7 times the filter's, in one run without a break that ends in the filter's own bytes."""
    run = recorded(config, log_of("udacity_laser_radar"))
    smoothed = smoothed_run(run.assembly, run.readings)
    assert smoothed.followed
    assert smoothed.segments == 1
    before, after = walker_errors(run, smoothed)
    assert set(before) == {"x", "y", "vx", "vy"}
    assert all(after[name] < 0.7 * before[name] for name in before)


@pytest.mark.recordings("px4_iris")
def test_a_flight_is_nearer_to_fixes_it_was_not_given(log_of):
    """Position and velocity over windows of 2 s without fixes: at most 0.9 times the filter's distance."""
    for filtered, smoothed in withheld_m(recorded("px4_iris", log_of("px4_iris"))).values():
        assert smoothed < 0.9 * filtered


@pytest.mark.recordings("udacity_laser_radar", "px4_iris")
def test_the_pages_table_is_measured_again(recording, tmp_path):
    from tools.pages.smoothing_page import recordings

    runs = recordings(recording("px4_iris").parent, tmp_path)
    table = recordings_table(((name, runs[name]) for name in WALKERS), runs["px4_iris"])
    assert table in PAGE.read_text(encoding="utf-8")
