"""PX4's Iris, watched: a strapdown filter on five sensors, none of which lies."""

from __future__ import annotations

import pytest

from tests.recordings.watched import watched

pytestmark = pytest.mark.recordings("px4_iris")


def test_a_flight_is_no_fault(log_of):
    """The first 15 s, from an unknown heading, take-off included: everything stays healthy, the model is not blamed."""
    run = watched("px4_iris", log_of("px4_iris"), {})
    reports = run.run(until_s=15.0)
    assert not reports["health"].any()
    assert not reports["model"].any()
