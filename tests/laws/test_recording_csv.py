from __future__ import annotations

import gzip
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusiond.engine.records import HAS_ARRIVAL, HAS_SEQ
from fusiond.errors import LogError
from fusiond.recording import csv_log
from fusiond.recording.csv_log import CsvLog
from fusiond.recording.csv_writer import write_csv
from fusiond.recording.decimal_time import nanoseconds_column, nanoseconds_of, seconds_text
from fusiond.types import TICK, Verdict
from tests.laws.recording_samples import joined, layout_of, readings_of

INT64 = st.integers(-(2**63), 2**63 - 1)


@pytest.fixture
def log_of(tmp_path):
    """A log of the given text."""

    def make(text: str, *sensors: str) -> CsvLog:
        path = tmp_path / "log.csv"
        path.write_text(text, encoding="utf-8", newline="")
        return CsvLog(path, layout_of(*(sensors or ("gps", "imu", "speed"))))

    return make


@given(INT64)
def test_every_nanosecond_survives_as_decimal_seconds(t_ns):
    assert nanoseconds_of(seconds_text(t_ns)) == t_ns
    assert nanoseconds_column([seconds_text(t_ns)])[0] == t_ns


@given(st.lists(st.from_regex(r"\A[+-]?[0-9]{1,9}(\.[0-9]{0,12})?(e-?[0-9])?\Z"), min_size=1, max_size=5))
def test_a_column_is_read_as_its_cells_are(texts):
    try:
        cells = [nanoseconds_of(text) for text in texts]
    except ValueError:
        with pytest.raises(ValueError, match="fit"):
            nanoseconds_column(texts)
        return
    assert nanoseconds_column(texts).tolist() == cells


@given(st.decimals(allow_nan=False, allow_infinity=False, min_value=-9e9, max_value=9e9))
def test_finer_than_a_nanosecond_rounds_to_the_nearest(number):
    exact = Decimal(number) * 10**9
    assert abs(nanoseconds_of(f"{number:f}") - exact) <= Decimal("0.5")


@pytest.mark.parametrize(
    "text", ["", "x", "1_0", "1 5.2", "nan", "inf", "1e400", "9223372037", "0x10", "\u0661"]
)
def test_what_is_no_time_is_refused(text):
    with pytest.raises(ValueError, match=r"decimal|fit"):
        nanoseconds_of(text)
    with pytest.raises(ValueError, match=r"decimal|fit"):
        nanoseconds_column(["0.5", text])


@pytest.mark.parametrize(
    ("text", "unit", "t_ns"), [("1.5", "ms", 1_500_000), ("7", "us", 7000), ("3", "ns", 3)]
)
def test_units_of_time(text, unit, t_ns):
    assert nanoseconds_of(text, unit) == t_ns


@given(st.integers(1, 60), st.integers(0, 2**32))
def test_csv_reads_back_bit_for_bit(tmp_path_factory, count, seed):
    layout = layout_of("gps", "imu", "speed")
    readings = readings_of(layout, count, seed)
    path = tmp_path_factory.mktemp("csv") / "log.csv"
    write_csv(path, layout, [readings])
    assert joined(CsvLog(path, layout)).tobytes() == readings.tobytes()


def test_the_careful_path_reads_what_the_fast_one_does(tmp_path, monkeypatch):
    layout = layout_of("gps", "imu", "speed")
    write_csv(tmp_path / "log.csv", layout, [readings_of(layout, 500)])
    log = CsvLog(tmp_path / "log.csv", layout)
    fast = joined(log)
    monkeypatch.setattr(CsvLog, "_fast", CsvLog._careful)
    assert joined(log).tobytes() == fast.tobytes()


CELLS = [
    "",
    " ",
    "1",
    "-2.5",
    "3e-9",
    "1_0",
    "1 ",
    "nan",
    "-inf",
    "x",
    "\u0661",
    "18446744073709551616",
    "1.0000000005",
]
ROWS = st.tuples(
    st.sampled_from(["1", "2.5", "-0.25", "1e1", " 3", "", "x", "1_0", "1e30"]),
    st.sampled_from(["gps", "imu", " gps ", "lidar", "tick", ""]),
    st.lists(st.sampled_from(CELLS), max_size=4),
).map(lambda row: ",".join([row[0], row[1], *row[2]]))


@given(st.lists(ROWS, max_size=3).map("\n".join) | st.text(alphabet="1.,-eE_ gps\n\u0661", max_size=40))
def test_both_paths_agree_on_any_text(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("csv") / "log.csv"
    path.write_text("t_s,sensor,z0,z1,seq\n" + text, encoding="utf-8", newline="")
    log = CsvLog(path, layout_of("gps", "imu"))
    read, refused = joined(log), dict(log.refusals.counts)
    careful = [log._careful([line], 2) for line in text.split("\n") if line.strip()]
    expected = np.concatenate([np.zeros(0, log.layout.reading), *careful])
    assert read.tobytes() == expected.tobytes()
    assert sum(log.refusals.counts.values()) == 2 * sum(refused.values())


def test_blocks_cut_anywhere_give_the_same_readings(tmp_path, monkeypatch):
    layout = layout_of("gps", "imu", "speed")
    write_csv(tmp_path / "log.csv", layout, [readings_of(layout, 300)])
    log = CsvLog(tmp_path / "log.csv", layout)
    whole = joined(log)
    monkeypatch.setattr(csv_log, "BLOCK", 97)
    assert joined(log).tobytes() == whole.tobytes()


def test_bad_rows_are_counted_with_the_line_of_the_first(log_of):
    log = log_of(
        "t_s,sensor,z0,z1\n"
        "1,gps,1,2\n"
        "1.1,lidar,1\n"
        "\n"
        "noon,gps,1,2\n"
        "1.2,gps,one,2\n"
        "1.3,gps,1,2,3,4\n"
        "1.4,gps,,2\n"
        "1.5,gps,1,2\n"
    )
    assert joined(log)["t_ns"].tolist() == [10**9, 1_500_000_000]
    assert log.refusals.counts == {Verdict.UNKNOWN_SENSOR: 1, Verdict.MALFORMED: 4}
    assert "line 3" in log.refusals.first[Verdict.UNKNOWN_SENSOR]
    assert "line 5" in log.refusals.first[Verdict.MALFORMED]


def test_unknown_sensors_leave_the_fast_path_fast(log_of, monkeypatch):
    monkeypatch.setattr(CsvLog, "_careful", None)
    log = log_of("t_s,sensor,z0\n1,gps,1\n2,lidar,1\n3,lidar,1\n4,gps,1\n")
    assert joined(log)["t_ns"].tolist() == [10**9, 4 * 10**9]
    assert log.refusals.counts == {Verdict.UNKNOWN_SENSOR: 2}
    assert "line 3" in log.refusals.first[Verdict.UNKNOWN_SENSOR]


def test_iterating_again_counts_afresh(log_of):
    log = log_of("t_s,sensor,z0\n1,lidar,1\n2,gps,1\n")
    joined(log)
    joined(log)
    assert log.refusals.counts == {Verdict.UNKNOWN_SENSOR: 1}


def test_nan_and_infinity_are_readings(log_of):
    log = log_of("t_s,sensor,z0,z1\n1,gps,nan,-inf\n")
    z = joined(log)["z"][0]
    assert np.isnan(z[0])
    assert z[1] == -np.inf
    assert not log.refusals.counts


def test_missing_cells_make_a_shorter_reading_and_surplus_ones_keep_its_length(log_of):
    log = log_of("t_s,sensor,z0,z1,z2,z3\n1,gps,1\n2,gps,1,2\n3,gps,1,2,3,4\n4,gps\n")
    readings = joined(log)
    assert readings["length"].tolist() == [1, 2, 4, 0]
    assert readings["z"][2].tolist() == [1.0, 2.0, 3.0]


def test_columns_stand_in_any_order_and_optional_ones_may_be_empty(log_of):
    readings = joined(log_of("seq,z0,arrival_s,sensor,t_s\n7,1.5,2.5,speed,2\n,1.5,,speed,3\n"))
    assert readings["flags"].tolist() == [HAS_SEQ | HAS_ARRIVAL, 0]
    assert readings["seq"].tolist() == [7, 0]
    assert readings["arrival_ns"].tolist() == [2_500_000_000, 0]


def test_a_row_named_tick_is_time_passing(log_of):
    assert joined(log_of("t_s,sensor,z0\n1,tick\n"))["sensor"].tolist() == [TICK]


def test_windows_line_ends_a_byte_order_mark_and_no_last_newline(log_of):
    assert joined(log_of("\ufefft_s,sensor,z0\r\n1,speed,2\r\n2,speed,3"))["z"][:, 0].tolist() == [2.0, 3.0]


@pytest.mark.parametrize(
    "header", ["", "time,sensor,z0", "t_s,z0", "t_s,sensor,z0,z2", "t_s,sensor,z0,z0", "t_s,sensor,z0,speed"]
)
def test_a_wrong_header_is_an_error_with_its_remedy(log_of, header):
    with pytest.raises(LogError, match=r"header .*; write t_s,sensor"):
        log_of(header + "\n1,gps,2\n")


def test_a_missing_file_is_an_error(tmp_path):
    with pytest.raises(LogError, match="name an existing log"):
        CsvLog(tmp_path / "none.csv", layout_of("gps"))


def test_gzip_whole_and_cut_short(tmp_path):
    layout = layout_of("gps", "imu", "speed")
    write_csv(tmp_path / "log.csv", layout, [readings_of(layout, 20_000)])
    packed = gzip.compress((tmp_path / "log.csv").read_bytes())
    (tmp_path / "log.csv.gz").write_bytes(packed)
    log = CsvLog(tmp_path / "log.csv.gz", layout)
    assert len(joined(log)) == 20_000
    assert not log.warnings

    (tmp_path / "log.csv.gz").write_bytes(packed[: len(packed) * 3 // 4])
    assert 0 < len(joined(log)) < 20_000
    assert "cut short" in log.warnings[0]
