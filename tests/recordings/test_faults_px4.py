"""PX4's Iris, watched: a strapdown filter on five sensors, none of which lies."""

from __future__ import annotations

import pytest

from tests.recordings.watched import watched

pytestmark = pytest.mark.recordings("px4_iris")
# Where the heading is unknown within a radian, as the configuration has it, the magnetometer's first readings are
# linearised far from the truth: all five are suspected for the first 0.9 s (one set that nothing tells apart), nobody
# is excluded. Whoever looks for faults starts at what the magnetometer says at rest, 24.7 degrees, within 0.1 rad.
# The field of the place is what the reference filter starts with and later corrects: 0.02 gauss of it is no fault.
FIELD = "field_x_gauss = 0.02\nfield_y_gauss = 0.02\nfield_z_gauss = 0.02\n"
ALIGNED = {
    "state = { qw = 1.0 }": "state = { qw = 0.9768, qz = 0.2141 }",
    "attitude_z_rad = 0.6": "attitude_z_rad = 0.1",
    'repeats = "held"': 'repeats = "held"\n[sensor.magnetometer.tolerance]\n' + FIELD,
}


def test_a_flight_is_no_fault(log_of):
    """The first 15 s, take-off included: everything stays healthy, the model is not blamed."""
    run = watched("px4_iris", log_of("px4_iris"), ALIGNED)
    reports = run.run(until_s=15.0)
    assert not reports["health"].any()
    assert not reports["model"].any()
