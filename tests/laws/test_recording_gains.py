"""Import of what recordings give between rows, of several columns, and earth-fixed: rates, means and places."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusiond.errors import ConfigError
from fusiond.recording.importing import import_recording
from fusiond.recording.importing.mapping import mapping_of, read_mapping
from fusiond.recording.importing.numbers import ECCENTRICITY_2, EQUATOR_M, Frames, geodetic, on_the_plane
from fusiond.recording.log import open_log
from fusiond.types import Verdict

WHEELS = """
time = "t"
[sensor.wheels]
values = [
    { name = "speed", unit = "m_s", from = "way", per_s = true, scale = 2.0 },
    { name = "angle", unit = "rad", from = "angle" },
    { name = "mean", from = 0, field_scale = 1.0 },
]
"""


def earth_fixed(latitude_deg, longitude_deg, height_m):
    """The textbook's direction: from the ellipsoid to earth-fixed x, y, z."""
    latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
    N = EQUATOR_M / math.sqrt(1.0 - ECCENTRICITY_2 * math.sin(latitude) ** 2)
    across = (N + height_m) * math.cos(latitude)
    up = (N * (1.0 - ECCENTRICITY_2) + height_m) * math.sin(latitude)
    return across * math.cos(longitude), across * math.sin(longitude), up


@given(st.floats(-90.0, 90.0), st.floats(-179.9, 179.9), st.floats(-5000.0, 20000.0))
@settings(max_examples=60)
def test_a_place_on_the_ellipsoid_is_found_again(latitude, longitude, height):
    """Within a micrometre, from the sea's bottom to an aircraft, poles included."""
    place = geodetic(*earth_fixed(latitude, longitude, height))
    assert place[0] == pytest.approx(latitude, abs=1e-11)
    assert math.cos(math.radians(latitude)) * (place[1] - longitude) == pytest.approx(0.0, abs=1e-11)
    assert place[2] == pytest.approx(height, abs=1e-6)


def test_an_earth_fixed_place_lies_where_its_latitude_does():
    """In the plane of `east_of`: the same numbers for the same place, whichever way it is written."""
    frames = Frames((37.7, -122.5))
    by_degrees = frames.projection.east_north_m(37.71, -122.49)
    place = geodetic(*earth_fixed(37.71, -122.49, 30.0))
    found = [
        on_the_plane(kind, place, frames) for kind in ("ecef_east_of", "ecef_north_of", "ecef_altitude_of")
    ]
    assert found == pytest.approx([*by_degrees, 30.0], abs=1e-5)


@pytest.fixture
def imported(tmp_path):
    """Readings of a text by a mapping."""

    def run(text, mapping=WHEELS):
        (tmp_path / "rows.csv").write_text(text)
        (tmp_path / "map.toml").write_text(mapping)
        result = import_recording(tmp_path / "rows.csv", tmp_path / "map.toml", tmp_path / "out.mcap")
        layout = read_mapping(tmp_path / "map.toml").layout("x")
        return result, np.concatenate(list(open_log(tmp_path / "out.mcap", layout)))

    return run


def test_a_gain_is_divided_by_the_time_since_the_row_before(imported):
    """The first row has no row before: it is left out, and nothing is refused. Other values stay as they are."""
    result, readings = imported("t,way,angle\n1.0,9,1\n1.1,0.5,2\n1.35,0.5,3\n")
    assert not result.refusals.counts
    assert readings["t_ns"].tolist() == [1_100_000_000, 1_350_000_000]
    assert readings["z"][:, 0] == pytest.approx([10.0, 4.0])
    assert readings["z"][:, 1].tolist() == [2.0, 3.0]


@pytest.mark.parametrize("stamp", ["1.1", "1.0"])
def test_a_gain_in_no_time_is_refused(imported, stamp):
    """A row that is not later than the one before has no rate; the next one counts from the last that was."""
    result, readings = imported(f"t,way,angle\n1.0,9,1\n1.1,0.5,2\n{stamp},0.5,3\n1.2,0.5,4\n")
    assert result.refusals.counts[Verdict.MALFORMED] == 1
    assert readings["z"][:, 0] == pytest.approx([10.0, 10.0])


def test_a_mean_is_of_all_its_columns(imported):
    mapping = WHEELS.replace("from = 0, field_scale = 1.0", 'mean_of = ["way", 2, "angle"], scale = 3.0')
    _, readings = imported("t,way,angle\n1,0,0\n2,4,10\n", mapping)
    assert readings["z"][0, 2] == pytest.approx(24.0)


@pytest.mark.parametrize(
    ("value", "told"),
    [
        ({"mean_of": []}, "is not a list of column"),
        ({"mean_of": [1.5]}, "is not a list of column"),
        ({"ecef_east_of": [0, 1]}, "is not 3 column"),
    ],
)
def test_columns_that_are_none_are_an_error(value, told):
    with pytest.raises(ConfigError, match=told):
        mapping_of({"time": 0, "sensor": {"a": {"values": [{"name": "b", **value}]}}}, "map.toml")
