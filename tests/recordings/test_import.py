"""Import of the recordings nobody here made: every number is where its owner put it."""

from __future__ import annotations

import csv
import gzip
import math
from pathlib import Path

import numpy as np
import pytest

from fusiond.errors import ConfigError, LogError
from fusiond.recording.importing import import_recording
from fusiond.recording.importing.mapping import read_mapping
from fusiond.recording.log import open_log
from fusiond.recording.truth import read_truth

MAPPINGS = Path(__file__).resolve().parents[2] / "configs" / "import"
pytestmark = pytest.mark.recordings(
    "jackal", "dresden_car", "udacity_laser_radar", "plaza2_uwb_mower", "comma2k19"
)


@pytest.fixture
def imported(recording, tmp_path):
    """Import with a mapping of the project, or with one given as text; the result and all readings."""

    def run(src: Path, mapping: str, out: str = "out.mcap", **options):
        path = MAPPINGS / f"{mapping}.toml"
        if "\n" in mapping:
            path = tmp_path / "map.toml"
            path.write_text(mapping)
        result = import_recording(src, path, tmp_path / out, **options)
        layout = read_mapping(path).layout("x")
        log = open_log(tmp_path / out, layout)
        readings = np.concatenate(list(log))
        assert not log.warnings
        assert not log.refusals.counts
        return (
            result,
            {name: readings[readings["sensor"] == k] for name, k in layout.numbers.items()},
            readings,
        )

    return run


def test_the_jackal_bag_and_its_decode_are_the_same_log(imported, recording):
    folder = recording("jackal")
    from_bag, _, bag = imported(folder / "test2.bag", "jackal")
    from_csv, _, text = imported(folder, "jackal_csv")
    assert from_bag.readings == from_csv.readings == {"odometry": 3060, "imu": 3061}
    for readings in (bag, text):
        assert np.all(np.diff(readings["arrival_ns"]) >= 0)
    order = [np.lexsort((r["t_ns"], r["sensor"], r["arrival_ns"])) for r in (bag, text)]
    assert bag[order[0]].tobytes() == text[order[1]].tobytes()


def test_jackal_numbers_are_those_of_the_file(imported, recording):
    folder = recording("jackal")
    _, sensors, _ = imported(folder / "test2.bag", "jackal")
    with gzip.open(folder / "imu_data.csv.gz", "rt") as file:
        row = next(csv.DictReader(file))
    first = sensors["imu"][0]
    assert first["t_ns"] == 47_580_000_000
    assert first["z"][1] == float(row["wz"])
    w, z = float(row["qw"]), float(row["qz"])
    assert first["z"][0] == pytest.approx(2.0 * math.atan2(z, w), abs=5e-3)


def test_jackal_dead_reckoning_ends_where_published(imported, recording):
    """Levelled wheel speed turned by the IMU's yaw, summed, ends within 0.02 m of the published (1.0206, 3.4292) m."""
    _, sensors, _ = imported(recording("jackal") / "test2.bag", "jackal")
    odometry, imu = sensors["odometry"], sensors["imu"]
    yaw = np.interp(odometry["t_ns"], imu["t_ns"], np.unwrap(imu["z"][:, 0]))
    dt_s = np.diff(odometry["t_ns"], prepend=odometry["t_ns"][0]) / 1e9
    x = float(np.sum(odometry["z"][:, 0] * np.cos(yaw) * dt_s))
    y = float(np.sum(odometry["z"][:, 0] * np.sin(yaw) * dt_s))
    assert math.hypot(x - 1.0206, y - 3.4292) < 0.02


def test_dresden_repeats_stand_as_they_are_and_units_are_si(imported, recording):
    path = next(recording("dresden_car").glob("*.csv"))
    result, sensors, _ = imported(path, "dresden_car")
    assert set(result.readings.values()) == {10_800}
    gps, speed = sensors["gps"]["z"], sensors["speed"]["z"][:, 0]
    moved = int(np.sum(np.any(np.diff(gps[:, :2], axis=0) != 0.0, axis=1))) + 1
    assert moved == pytest.approx(2117, abs=1)
    assert speed[0] == pytest.approx(2.42 / 3.6)
    assert sensors["yaw_rate"]["z"][0, 0] == pytest.approx(math.radians(-18.713))
    assert sensors["course"]["z"][0, 0] == pytest.approx(math.radians(90.0 - 324.2 + 360.0))
    assert sensors["gps"]["t_ns"][0] == 1_395_837_505_119_146_000


def test_dresden_geometry_holds_together(imported, recording):
    """The way between fixes is the 1,762 m driven, and the course points along it."""
    path = next(recording("dresden_car").glob("*.csv"))
    _, sensors, _ = imported(path, "dresden_car")
    steps = np.diff(sensors["gps"]["z"][:, :2], axis=0)
    way_m = float(np.sum(np.hypot(steps[:, 0], steps[:, 1])))
    assert way_m == pytest.approx(1762.0, rel=0.02)
    apart = 250
    chord = sensors["gps"]["z"][apart:, :2] - sensors["gps"]["z"][:-apart, :2]
    fast = np.hypot(chord[:, 0], chord[:, 1]) > 30.0
    heading = np.arctan2(chord[:, 1], chord[:, 0])[fast]
    course = sensors["course"]["z"][apart // 2 : -apart // 2, 0][fast]
    assert np.median(np.abs(np.angle(np.exp(1j * (heading - course))))) < 0.2


def test_dresden_yaw_rate_turns_the_way_and_as_far_as_the_course_does(imported, recording):
    """Sign and scale: the turned angle over 2 s equals the course's change 1 s later (the receiver's lag) to 5 %."""
    path = next(recording("dresden_car").glob("*.csv"))
    _, sensors, _ = imported(path, "dresden_car")
    t_s = (sensors["course"]["t_ns"] - sensors["course"]["t_ns"][0]) / 1e9
    rate = sensors["yaw_rate"]["z"][:, 0]
    turned = np.concatenate([[0.0], np.cumsum(rate[1:] * np.diff(t_s))])
    at_s = np.arange(2.0, 212.0, 2.0)
    moving = np.interp(at_s[:-1], t_s, sensors["speed"]["z"][:, 0]) > 3.0
    by_gyro = np.diff(np.interp(at_s, t_s, turned))[moving]
    by_course = np.diff(np.interp(at_s + 1.0, t_s, np.unwrap(sensors["course"]["z"][:, 0])))[moving]
    assert np.polyfit(by_gyro, by_course, 1)[0] == pytest.approx(1.0, abs=0.05)
    assert np.corrcoef(by_gyro, by_course)[0, 1] > 0.9


def test_udacity_has_two_sensors_and_a_truth(imported, recording, tmp_path):
    path = next(recording("udacity_laser_radar").glob("*.txt"))
    result, sensors, readings = imported(path, "udacity_laser_radar")
    assert result.readings == {"laser": 250, "radar": 250}
    assert np.all(np.diff(readings["t_ns"]) == 50_000_000)
    rows, truth_path = result.truth
    assert rows == 500
    truth = read_truth(truth_path, ())
    assert truth.names == ("x", "y", "vx", "vy")
    at, covered = truth.at(sensors["laser"]["t_ns"])
    assert covered.all()
    assert np.std(sensors["laser"]["z"][:, :2] - at[:, :2]) == pytest.approx(0.15, rel=0.1)
    at, _ = truth.at(sensors["radar"]["t_ns"])
    distance = np.hypot(at[:, 0], at[:, 1])
    rate = np.sum(at[:, :2] * at[:, 2:], axis=1) / distance
    assert np.std(sensors["radar"]["z"][:, 0] - distance) == pytest.approx(0.3, rel=0.15)
    assert np.std(sensors["radar"]["z"][:, 2] - rate) == pytest.approx(0.3, rel=0.15)


def test_csv_and_mcap_hold_the_same_readings(imported, recording):
    path = next(recording("udacity_laser_radar").glob("*.txt"))
    _, _, packed = imported(path, "udacity_laser_radar")
    _, _, plain = imported(path, "udacity_laser_radar", "json.mcap", json_readings=True)
    _, _, text = imported(path, "udacity_laser_radar", "out.csv")
    assert packed.tobytes() == text.tobytes() == plain.tobytes()


PLAZA = """
time = 0
[sensor.odometry]
key = "DR"
values = [{ name = "distance", unit = "m", from = 1 }, { name = "turn", unit = "rad", from = 2 }]
[sensor.uwb]
key = "TD"
values = [{ name = "beacon", from = 2 }, { name = "range", unit = "m", from = 3 }]
[truth]
key = "GT"
values = [{ name = "x", unit = "m", from = 1 }, { name = "y", unit = "m", from = 2 }]
"""
PLAZA_TEXT = PLAZA.replace('key = "DR"', 'file = "Plaza2_DR.txt"').replace(
    'key = "TD"', 'file = "Plaza2_TD.txt"'
)
PLAZA_TEXT = PLAZA_TEXT[: PLAZA_TEXT.index("[truth]")].replace(
    "time = 0", 'time = 0\nheader = false\ndelimiter = ","', 1
)


def test_a_mat_file_and_its_text_are_the_same_log(imported, recording):
    folder = recording("plaza2_uwb_mower")
    from_mat, mat, merged = imported(folder / "Plaza2_.mat", PLAZA)
    assert np.all(np.diff(merged["t_ns"]) >= 0)
    assert from_mat.truth[0] > 1000
    first = (folder / "Plaza2_DR.txt").read_text().splitlines()[0]
    text_map = PLAZA_TEXT if "," in first else PLAZA_TEXT.replace('","', '"whitespace"')
    from_text, text, _ = imported(folder, text_map)
    assert from_text.readings == from_mat.readings
    for name in ("odometry", "uwb"):
        assert np.abs(text[name]["t_ns"] - mat[name]["t_ns"]).max() < 1_000_000
        assert text[name]["z"] == pytest.approx(mat[name]["z"], abs=1e-3)


def test_numpy_pairs_and_on_change(imported, recording):
    folder = recording("comma2k19")
    time_file = next(p for p in sorted(folder.rglob("t")) if p.parent.name == "wheel_speed")
    inside = time_file.parent.relative_to(folder)
    mapping = f"""
time = "t"
time_file = "{inside}/t"
value_file = "{inside}/value"
[sensor.wheels]
values = [{{ name = "front_left", unit = "m_s", from = 0 }}, {{ name = "rear_right", unit = "m_s", from = 3 }}]
[sensor.changes]
on_change = true
values = [{{ name = "front_left", unit = "m_s", from = 0 }}]
"""
    result, sensors, _ = imported(folder, mapping)
    times, values = np.load(time_file), np.load(time_file.parent / "value")
    assert result.readings["wheels"] == len(times)
    assert sensors["wheels"]["z"].tobytes() == values[:, [0, 3]].astype(float).tobytes()
    assert np.abs(sensors["wheels"]["t_ns"] / 1e9 - times).max() < 1e-6
    assert result.readings["changes"] == 1 + np.sum(np.diff(values[:, 0]) != 0.0)


@pytest.mark.parametrize(
    ("change", "error", "fact"),
    [
        (("/imu/data", "/imu/date"), ConfigError, "only /imu/data"),
        (("angular_velocity.z", "angular_velocity.yaw"), ConfigError, "only x, y, z"),
        (("header.stamp", "header.time"), ConfigError, "has no 'time'"),
    ],
)
def test_a_mapping_that_names_what_is_not_there_is_an_error(imported, recording, change, error, fact):
    mapping = (MAPPINGS / "jackal.toml").read_text().replace(*change)
    with pytest.raises(error, match=fact):
        imported(recording("jackal") / "test2.bag", mapping)


def test_a_file_that_is_no_bag_is_an_error(imported, tmp_path):
    (tmp_path / "x.bag").write_bytes(b"#ROSBAG V2.0\nno more")
    with pytest.raises(LogError, match="rosbags"):
        imported(tmp_path / "x.bag", "jackal")
