"""docs/recordings.md says what is measured."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.pages.recorded import recorded
from tools.pages.recording_rows import dresden_rows, jackal_rows, table, udacity_rows

pytestmark = pytest.mark.recordings("jackal", "dresden_car", "udacity_laser_radar")
PAGE = Path(__file__).resolve().parents[2] / "docs" / "recordings.md"


def test_every_table_of_the_page_is_measured_again(log_of):
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
