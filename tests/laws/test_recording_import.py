"""Laws of the importer: geometry, order, and the mistakes of a mapping."""

from __future__ import annotations

import json
import math
import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.writer import Writer

from fusiond.errors import ConfigError, LogError
from fusiond.recording.importing import import_recording
from fusiond.recording.importing.mapping import mapping_of
from fusiond.recording.importing.numbers import (
    EQUATOR_M,
    Frames,
    Projection,
    converted,
    pitch_rad,
    roll_rad,
    yaw_rad,
)
from fusiond.recording.log import open_log
from fusiond.types import Verdict

ANGLE = st.floats(-math.pi, math.pi)


def quaternion(roll: float, pitch: float, yaw: float) -> tuple[float, float, float, float]:
    """x, y, z, w of the rotation z-y-x."""
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(a / 2), math.sin(a / 2)) for a in (roll, pitch, yaw))
    return (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )


@given(ANGLE, st.floats(-1.5, 1.5), ANGLE)
def test_yaw_is_that_of_the_quaternion(roll, pitch, yaw):
    error = yaw_rad(*quaternion(roll, pitch, yaw)) - yaw
    assert math.cos(error) == pytest.approx(1.0, abs=1e-9)


@given(ANGLE, st.floats(-1.5, 1.5), ANGLE)
def test_roll_and_pitch_are_those_of_the_quaternion(roll, pitch, yaw):
    assert math.cos(roll_rad(*quaternion(roll, pitch, yaw)) - roll) == pytest.approx(1.0, abs=1e-9)
    assert pitch_rad(*quaternion(roll, pitch, yaw)) == pytest.approx(pitch, abs=1e-9)


def test_fields_are_scaled_before_they_are_used(tmp_path):
    """Latitude and longitude in 1e-7 deg: a second row 1e-4 deg north and east is 11.1 m north."""
    mapping = tmp_path / "mapping.toml"
    mapping.write_text(
        "header = false\ntime = 0\n[sensor.gps]\nvalues = ["
        '{ name = "x", unit = "m", east_of = [1, 2], field_scale = 1e-7 },'
        '{ name = "y", unit = "m", north_of = [1, 2], field_scale = 1e-7 }]'
    )
    source = tmp_path / "rows.csv"
    source.write_text("0,0,50000000\n1,1000,50001000\n")
    import_recording(source, mapping, tmp_path / "rows_out.csv")
    last = (tmp_path / "rows_out.csv").read_text().splitlines()[-1].split(",")
    assert [float(number) for number in last[-2:]] == pytest.approx([11.132, 11.057], abs=1e-3)


@given(ANGLE, st.floats(-1.5, 1.5), ANGLE, st.floats(-5, 5))
def test_levelled_speed_is_shortened_by_the_pitch_alone(roll, pitch, yaw, speed):
    frames = Frames(None)
    frames.attitude = quaternion(roll, pitch, yaw)
    forward, left = frames.level(speed, 0.0, 0.0)
    assert forward == pytest.approx(speed * math.cos(pitch), abs=1e-9)
    assert left == pytest.approx(0.0, abs=1e-9)


@given(st.floats(-70, 70), st.floats(-180, 180))
def test_east_and_north_are_metres_on_the_ellipsoid(latitude, longitude):
    """A second of arc north is 30.7 to 31.0 m everywhere; east is that of the parallel's circle."""
    step = 1.0 / 3600.0
    projection = Projection((latitude, longitude))
    assert projection.east_north_m(latitude, longitude) == pytest.approx((0.0, 0.0), abs=1e-6)
    east, north = projection.east_north_m(latitude + step, longitude + step)
    assert 30.7 < north < 31.03
    circle_m = 2 * math.pi * EQUATOR_M * math.cos(math.radians(latitude)) / (360 * 3600)
    assert circle_m <= east * (1 + 1e-9) < circle_m * 1.0035


def test_the_date_line_is_no_jump():
    east, _ = Projection((0.0, 179.9999)).east_north_m(0.0, -179.9999)
    assert east == pytest.approx(22.26, abs=0.01)


@pytest.mark.parametrize(
    ("course", "yaw"), [(0, math.pi / 2), (90, 0), (180, -math.pi / 2), (359, math.radians(91))]
)
def test_a_course_from_north_is_a_yaw_from_east(course, yaw):
    assert converted(course, "course_deg_to_yaw_rad") == pytest.approx(yaw)


BASE = """
time = "t"
[sensor.a]
values = [{ name = "x", from = "x" }]
"""


@pytest.mark.parametrize(
    ("change", "fact"),
    [
        (("[sensor.a]", "tme = 1\n[sensor.a]"), "nobody reads tme"),
        (('time = "t"\n', ""), "says no time"),
        (('time = "t"', 'time = "t"\ntime_unit = "h"'), "'h' is no unit"),
        (("values = [", "value = ["), "nobody reads value;"),
        (('{ name = "x", from = "x" }', ""), "has no values"),
        (('from = "x"', 'from = "x", yaw_of = [1, 2, 3, 4]'), "from and yaw_of"),
        (('from = "x"', "yaw_of = [1, 2]"), "is not 4 column"),
        (('from = "x"', 'from = "x", convert = "miles"'), "'miles' is unknown"),
        (('from = "x"', "forward_of = [1, 2, 3]"), "add .attitude."),
        (('name = "x", ', ""), "has no name"),
        (("values", 'time_file = "t"\nvalues'), "only make sense together"),
        (("values", "where = { column = 1 }\nvalues"), "needs `column` and `equals`"),
        (("sensor.a", "sensor.attitude"), "the name is taken"),
        (("[sensor.a]", "[origin]\nlatitude = 1\n[sensor.a]"), "latitude and longitude"),
        (("sensor.a", "truth"), "maps no sensor"),
    ],
)
def test_a_wrong_mapping_says_what_to_write(change, fact):
    mapping_of(tomllib.loads(BASE), "map")
    with pytest.raises(ConfigError, match=fact):
        mapping_of(tomllib.loads(BASE.replace(*change)), "map")


@pytest.fixture
def importing(tmp_path):
    """Import a text (or a file) with a mapping; result and readings."""

    def run(content: str | None, mapping: str, src: str = "src.csv"):
        if content is not None:
            (tmp_path / src).write_text(content)
        (tmp_path / "map.toml").write_text(mapping)
        result = import_recording(tmp_path / src, tmp_path / "map.toml", tmp_path / "out.mcap")
        layout = mapping_of(tomllib.loads(mapping), "map").layout("x")
        return result, np.concatenate([np.zeros(0, layout.reading), *open_log(tmp_path / "out.mcap", layout)])

    return run


def test_several_files_are_merged_by_arrival_and_each_keeps_its_order(importing, tmp_path):
    (tmp_path / "other.csv").write_text("t,x,got\n1.0,9,1.5\n0.5,8,1.6\n1.7,7,1.55\n")
    mapping = BASE.replace('"t"', '"t"\narrival = "got"') + (
        '[sensor.b]\nfile = "other.csv"\nvalues = [{ name = "x", from = "x", scale = 2, offset = 1 }]\n'
    )
    result, readings = importing("t,x,got\n1.4,1,1.45\n1.5,2,1.58\n1.6,3,1.7\n", mapping)
    assert result.readings == {"a": 3, "b": 3}
    assert readings["z"][:, 0].tolist() == [1.0, 19.0, 2.0, 17.0, 15.0, 3.0]
    assert result.t_ns == (500_000_000, 1_700_000_000)


def test_a_bad_row_is_counted_and_the_rest_imported(importing):
    result, readings = importing("t,x\n1,1\n2,one\nx,1\n3,\n4\n5,5\n", BASE)
    assert readings["z"][:, 0].tolist() == [1.0, 5.0]
    assert result.refusals.counts == {Verdict.MALFORMED: 4}


def test_a_column_that_is_not_there_is_the_mappings_mistake(importing):
    with pytest.raises(ConfigError, match=r"sensor\.a: the recording has no column 'x', only t, y"):
        importing("t,y\n1,1\n", BASE)


def test_a_file_that_is_not_there_is_an_error(importing):
    with pytest.raises(LogError, match="is not there"):
        importing(None, BASE)


def test_velocity_before_the_first_orientation_is_counted(importing):
    mapping = """
time = "t"
[attitude]
where = { column = "kind", equals = "q" }
quaternion = ["a", "b", "c", "d"]
[sensor.a]
where = { column = "kind", equals = "v" }
values = [{ name = "vx", from = "a" }, { name = "v", forward_of = ["a", "b", "c"] }]
"""
    text = "t,kind,a,b,c,d\n0,v,1,0,0,0\n1,q,0,0.5,0,0.8660254037844386\n2,v,1,0,0,0\n"
    result, readings = importing(text, mapping)
    assert result.refusals.counts == {Verdict.MALFORMED: 1}
    assert readings["z"][0].tolist() == pytest.approx([1.0, 0.5])


def test_json_messages_of_an_mcap_file(importing, tmp_path):
    with (tmp_path / "src.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/pose", "json", 0)
        for k in range(3):
            message = {"header": {"stamp": {"sec": 5, "nanosec": k}}, "p": [k, {"x": k + 0.5}]}
            writer.add_message(channel, log_time=100 + k, data=json.dumps(message).encode(), publish_time=0)
        writer.add_message(channel, log_time=104, data=b"{", publish_time=0)
        writer.finish()
    sensor = '[sensor.a]\ntopic = "/pose"\nvalues = [{ name = "x", from = "p.1.x" }]\n'
    mapping = 'time = "header.stamp"\narrival = "log_time"\n' + sensor
    result, readings = importing(None, mapping, "src.mcap")
    assert readings["z"][:, 0].tolist() == [0.5, 1.5, 2.5]
    assert readings["t_ns"].tolist() == [5 * 10**9 + k for k in range(3)]
    assert readings["arrival_ns"].tolist() == [100, 101, 102]
    assert result.refusals.counts == {Verdict.MALFORMED: 1}
    with pytest.raises(ConfigError, match="has no topic /poses, only /pose"):
        importing(None, mapping.replace("/pose", "/poses"), "src.mcap")


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_a_rosbag2_and_its_single_file(importing, tmp_path, storage):
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as BagWriter
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS2_HUMBLE)
    twist, vector = types.types["geometry_msgs/msg/Twist"], types.types["geometry_msgs/msg/Vector3"]
    with BagWriter(tmp_path / "bag", version=9, storage_plugin=StoragePlugin[storage]) as bag:
        connection = bag.add_connection("/cmd", twist.__msgtype__, typestore=types)
        for k in range(3):
            message = twist(linear=vector(x=float(k), y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=-1.5))
            bag.write(connection, 1000 + k, types.serialize_cdr(message, twist.__msgtype__))
    mapping = (
        'time = "log_time"\n[sensor.a]\ntopic = "/cmd"\n'
        'values = [{ name = "v", from = "linear.x" }, { name = "w", from = "angular.z" }]\n'
    )
    single = next(p for p in (tmp_path / "bag").iterdir() if p.suffix in (".mcap", ".db3"))
    for src in ("bag", f"bag/{single.name}"):
        result, readings = importing(None, mapping, src)
        assert result.readings == {"a": 3}
        assert readings["t_ns"].tolist() == [1000, 1001, 1002]
        assert readings["z"].tolist() == [[0.0, -1.5], [1.0, -1.5], [2.0, -1.5]]
