"""PX4's Iris taking off and landing in its simulator, against the answer of PX4's own filter."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.recording.importing import import_recording
from fusiond.types import NANOSECONDS, Verdict
from tools.pages.recorded import CONFIGS, recorded
from tools.pages.trials import configured

pytestmark = pytest.mark.recordings("px4_iris")
POSITION_M, VELOCITY_M_S = 0.3, 0.2
"""As near as two sound filters are."""
SETTLED_S = 5.0
RUNS = {}


@pytest.fixture
def iris(recording, tmp_path_factory):
    """The recording and its reports, run once."""
    if "iris" not in RUNS:
        log = tmp_path_factory.mktemp("px4_iris") / "px4_iris.mcap"
        source = recording("px4_iris") / "iris_gps_input.csv"
        import_recording(source, CONFIGS / "import" / "px4_iris.toml", log)
        RUNS["iris"] = recorded("px4_iris", log)
    return RUNS["iris"]


def apart(run, reports):
    """(k, 6) estimate minus reference, position m and velocity m/s, at the reference's stamps after SETTLED_S."""
    truth = run.truth
    assert truth.names == ("x", "y", "z", "vx", "vy", "vz")
    settled = (truth.t_ns > SETTLED_S * NANOSECONDS) & (truth.t_ns <= reports["t_ns"][-1])
    rows = np.searchsorted(reports["t_ns"], truth.t_ns[settled], side="right") - 1
    return reports["x"][rows, :6] - truth.values[settled]


def rms(rows):
    """Of the length of each row."""
    return float(np.sqrt(np.mean(np.sum(rows**2, axis=1))))


def test_it_agrees_with_the_other_filter(iris):
    """After 5 s within 0.3 m and 0.2 m/s RMS, all three axes together; 0.15 m and 0.1 m/s are reached."""
    off = apart(iris, iris.reports)
    assert len(off) > 290
    assert rms(off[:, :3]) < 0.5 * POSITION_M
    assert rms(off[:, 3:]) < 0.5 * VELOCITY_M_S


def test_every_reading_has_its_verdict(iris):
    """Used, or held where the magnetometer's rows repeat its last measurement; nothing else."""
    verdicts = iris.reports["verdict"]
    held = verdicts == Verdict.HELD
    assert set(np.unique(verdicts)) == {Verdict.USED, Verdict.HELD}
    assert np.all(iris.of("magnetometer")[held])
    assert iris.used("magnetometer").sum() == 784
    assert iris.used("gnss_position").sum() == iris.used("gnss_velocity").sum() == 169


def test_the_heading_is_found_from_nothing(iris):
    """GIVEN a heading unknown within 0.6 rad, THEN the magnetometer has found the reference's 0.41 rad in a second."""
    at = np.searchsorted(iris.reports["t_ns"], NANOSECONDS)
    assert iris.assembly.engine().outputs(iris.reports["x"][at])["yaw"] == pytest.approx(0.41, abs=0.03)
    assert iris.reports["std"][at, 14] < 0.1


def test_the_stamps_of_gnss_are_late(iris):
    """With the 0.11 s of delay the fixes of the climb fit; without, their innovations are larger by half."""
    climbing = iris.used("gnss_position") & (iris.t_s > 20.5)
    late = {"gnss_position": {"delay_s": 0.0}, "gnss_velocity": {"delay_s": 0.0}}
    believed = configured("px4_iris", {"sensor": late}).engine().process(iris.readings)
    fits, misses = (np.abs(reports["nu"][climbing, 2]).mean() for reports in (iris.reports, believed))
    assert fits < 0.05
    assert misses > 1.5 * fits


def test_without_gnss_velocity_and_position_it_drifts(iris):
    """The figure is the fusion's: on IMU, barometer and magnetometer alone the horizontal position leaves 0.3 m."""
    fixes = [iris.assembly.layout.numbers[name] for name in ("gnss_position", "gnss_velocity")]
    kept = iris.readings[~np.isin(iris.readings["sensor"], fixes)]
    off = apart(iris, iris.assembly.engine().process(kept))
    assert rms(off[:, :2]) > POSITION_M
    assert np.sqrt(np.mean(off[:, 2] ** 2)) < POSITION_M
