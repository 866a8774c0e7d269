"""The mower, watched: all ranges read 6.9 % long, and that is what is said of them."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.types import Health, Kind
from tests.recordings.watched import watched
from tools.pages.recorded import import_from

pytestmark = pytest.mark.recordings("plaza2_uwb_mower")


def test_long_ranges_are_a_scale_and_nothing_else(recording, tmp_path):
    """GIVEN nothing of the scale, THEN the ranges are faulty by a factor of 1.069 +- 0.005, the odometry is not."""
    mower = watched("plaza2", import_from(recording("plaza2_uwb_mower"), "plaza2", tmp_path), {})
    reports = mower.run()
    assert mower.named(reports) == {("uwb", "scale")}
    uwb = mower.sensor("uwb")
    faulty = reports[reports["health"][:, uwb] == Health.FAULTY]
    assert np.all(faulty["fault"][:, uwb] == Kind.SCALE)
    assert np.all(np.abs(faulty["fault_size"][:, uwb] - 1.069) < 0.005)
