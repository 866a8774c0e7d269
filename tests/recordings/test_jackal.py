"""A Jackal's wheel odometry and IMU, recorded for robot_localization, whose own answer is the measure."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.recording.importing import import_recording
from tools.pages.recorded import CONFIGS, recorded

pytestmark = pytest.mark.recordings("jackal")
PUBLISHED_M = np.array([1.0206, 3.4292])
REACH_M = 0.05


@pytest.fixture
def jackal(log_of):
    return recorded("jackal", log_of("jackal"))


def test_the_robot_ends_where_published(jackal):
    """84 m of driving end within 0.05 m (horizontally) of another filter's last pose."""
    run = jackal.run()
    end = np.array([run.final["state"]["x"], run.final["state"]["y"]])
    assert np.hypot(*(end - PUBLISHED_M)) < REACH_M
    assert run.refused == {}
    assert {name: sensor.used for name, sensor in run.sensors.items()} == {"odometry": 3060, "imu": 3061}
    assert run.final["health"] == "nominal"


def test_the_decoded_files_end_in_the_same_state(jackal, recording, tmp_path):
    """The bag and its lossless decode are the same recording to the last bit of the state."""
    import_recording(recording("jackal"), CONFIGS / "import" / "jackal_csv.toml", tmp_path / "csv.mcap")
    decoded = recorded("jackal", tmp_path / "csv.mcap")
    assert decoded.run().state_sha256 == jackal.run().state_sha256


def test_a_position_nobody_measures_only_grows_more_uncertain(jackal):
    """GIVEN nothing observes the position, THEN its std grows from second to second, and covers the end."""
    std_m = np.hypot(jackal.reports["std"][:, 0], jackal.reports["std"][:, 1])
    assert std_m[0] == 0.0
    assert np.all(np.diff(std_m[::50]) > 0.0)
    assert np.hypot(*(jackal.reports["x"][-1, :2] - PUBLISHED_M)) < 3.0 * std_m[-1]


def test_without_the_imu_the_odometry_alone_ends_far_off(jackal):
    """The figure is the fusion's, not the trajectory's: without the IMU the end is metres away."""
    imu = jackal.assembly.layout.numbers["imu"]
    end = jackal.run(lambda chunk: chunk["sensor"] != imu).final["state"]
    assert np.hypot(end["x"] - PUBLISHED_M[0], end["y"] - PUBLISHED_M[1]) > 1.0
