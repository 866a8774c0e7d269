"""docs/recordings.md says what is measured."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.pages.recorded import FOLDERS, import_from, recorded
from tools.pages.recording_ranges_rows import mower_rows
from tools.pages.recording_rows import dresden_rows, jackal_rows, table, udacity_rows
from tools.pages.recording_strapdown_rows import delays, highway_rows, iris_rows, jackal_3d_rows

pytestmark = pytest.mark.recordings(
    "jackal", "dresden_car", "udacity_laser_radar", "px4_iris", "plaza2_uwb_mower", "comma2k19"
)
PAGE = Path(__file__).resolve().parents[2] / "docs" / "recordings.md"


def test_every_table_of_the_plane_is_measured_again(log_of):
    """Digit by digit; `python -m tools.pages.recordings` writes the page anew."""
    page = PAGE.read_text(encoding="utf-8")
    walker = log_of("udacity_laser_radar")
    tables = [
        jackal_rows(recorded("jackal", log_of("jackal"))),
        udacity_rows(recorded("udacity_laser_radar", walker), recorded("udacity_laser_radar_robot", walker)),
        dresden_rows(recorded("dresden_car", log_of("dresden_car"))),
    ]
    for rows in tables:
        assert table(rows) in page
        assert all(row.ok for row in rows)


def test_every_table_in_space_and_of_ranges_is_measured_again(recording, tmp_path):
    """The same for the strapdown filter's recordings and the mower."""
    page = PAGE.read_text(encoding="utf-8")

    def run(config, name):
        return recorded(config, import_from(recording(FOLDERS.get(name, name)), name, tmp_path))

    highway = run("comma2k19", "comma2k19")
    tables = [
        jackal_3d_rows(run("jackal_3d", "jackal_3d")),
        iris_rows(run("px4_iris", "px4_iris")),
        mower_rows(run("plaza2_scale", "plaza2"), run("plaza2", "plaza2")),
        highway_rows(highway),
    ]
    for rows in tables:
        assert table(rows) in page
        assert all(row.ok for row in rows)
    assert delays(highway) in page
