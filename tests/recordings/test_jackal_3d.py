"""A Jackal's IMU and wheels through the strapdown filter: in space, against another filter's last pose."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.recording.importing import import_recording
from tools.pages.recorded import CONFIGS, recorded

pytestmark = pytest.mark.recordings("jackal")
PUBLISHED_M = np.array([1.0206, 3.4292, 0.7419])
ALLOWED_M, REACH_M = 0.1383, 0.03
"""How far off the recording's own test may end, and what is reached."""
RUNS = {}


@pytest.fixture
def jackal(recording, tmp_path_factory):
    """The recording and its reports, run once."""
    if "jackal" not in RUNS:
        log = tmp_path_factory.mktemp("jackal_3d") / "jackal_3d.mcap"
        import_recording(recording("jackal") / "test2.bag", CONFIGS / "import" / "jackal_3d.toml", log)
        RUNS["jackal"] = recorded("jackal_3d", log)
    return RUNS["jackal"]


def test_the_robot_ends_where_published_in_all_three_axes(jackal):
    """84 m of driving over sloping ground end within 0.03 m of the other filter's last pose; 0.1383 m is allowed."""
    last = jackal.reports[-1]
    off_m = np.linalg.norm(last["x"][:3] - PUBLISHED_M)
    assert off_m < REACH_M < ALLOWED_M
    assert all(jackal.used(name).sum() == jackal.of(name).sum() for name in ("orientation", "odometry"))


def test_its_own_deviation_covers_the_end(jackal):
    """GIVEN nothing observes the position, THEN its deviation grows on all axes; the end lies within three."""
    std_m = jackal.reports["std"][:, :3]
    assert not std_m[0].any()
    assert np.all(np.diff(std_m[::150], axis=0) > 0.0)
    assert np.all(np.abs(jackal.reports["x"][-1, :3] - PUBLISHED_M) < 3.0 * std_m[-1])


def test_the_imu_s_biases_stay_what_a_good_imu_has(jackal):
    """Nothing leaks into them: below 1 mrad/s, and 0.05 m/s^2, at the end."""
    biases = jackal.reports["x"][-1, 6:12]
    assert np.abs(biases[:3]).max() < 1e-3
    assert np.abs(biases[3:]).max() < 0.05


def test_without_the_orientation_the_end_is_metres_off(jackal):
    """The figure is the fusion's: without the IMU's own attitude the heading at the start is anybody's guess."""
    number = jackal.assembly.layout.numbers["orientation"]
    end = jackal.run(lambda chunk: chunk["sensor"] != number).final["state"]
    assert np.hypot(end["x"] - PUBLISHED_M[0], end["y"] - PUBLISHED_M[1]) > 0.5
