from __future__ import annotations

import json
import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import Writer

from fusiond.engine.records import HAS_ARRIVAL
from fusiond.errors import LogError
from fusiond.recording.background import BackgroundWriter
from fusiond.recording.log import open_log
from fusiond.recording.mcap_blocks import McapFile
from fusiond.recording.mcap_log import McapLog
from fusiond.recording.mcap_writer import McapWriter
from fusiond.types import TICK, Verdict
from tests.laws.recording_samples import joined, layout_of, readings_of

LAYOUT = layout_of("gps", "imu", "speed")


def written(path, readings, layout=LAYOUT, **forms):
    with McapWriter(path, layout, "name = 'sample'", **forms) as writer:
        for start in range(0, len(readings), 100):
            writer.readings(readings[start : start + 100])
    return path


@given(st.integers(0, 300), st.integers(0, 2**32))
def test_packed_and_json_readings_both_read_back_bit_for_bit(tmp_path_factory, count, seed):
    folder = tmp_path_factory.mktemp("mcap")
    readings = readings_of(LAYOUT, count, seed, covariances=True)
    packed = McapLog(written(folder / "p.mcap", readings), LAYOUT)
    plain = McapLog(written(folder / "j.mcap", readings, packed=False, json_readings=True), LAYOUT)
    both = McapLog(written(folder / "b.mcap", readings, json_readings=True), LAYOUT)
    for log in (packed, plain, both):
        assert joined(log).tobytes() == readings.tobytes()
        assert not log.warnings
        assert not log.refusals.counts


def test_a_recording_says_what_it_holds(tmp_path):
    readings = readings_of(LAYOUT, 250)
    file = McapFile(written(tmp_path / "run.mcap", readings))
    assert len(list(file.walk())) == 3
    ticks = int(np.sum(readings["sensor"] == TICK))
    assert file.metadata["fusiond.end"]["readings"] == str(250 - ticks)
    assert file.metadata["fusiond.end"]["events"] == str(ticks)
    assert file.metadata["fusiond"]["config"] == "name = 'sample'"
    description = McapLog(tmp_path / "run.mcap", LAYOUT).description
    assert [sensor.name for sensor in description.sensors] == ["gps", "imu", "speed"]
    assert description.states == LAYOUT.states


def test_json_channels_carry_valid_json_under_a_schema_that_names_their_fields(tmp_path):
    readings = readings_of(LAYOUT, 200, covariances=True)
    with McapWriter(tmp_path / "run.mcap", LAYOUT, json_readings=True) as writer:
        writer.readings(readings)
        writer.message("estimate", {"t": 1.0, "state": {"position": 2.0}}, 10**9, 2 * 10**9)
        writer.message("health", b'{"t": 1.0, "service": "nominal"}', -5, -5)
    topics = set()
    with (tmp_path / "run.mcap").open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            if channel.message_encoding != "json":
                continue
            topics.add(channel.topic)
            content = json.loads(message.data, parse_constant=pytest.fail)
            properties = json.loads(schema.data)["properties"]
            assert content.keys() - {"length"} <= properties.keys()
            if channel.topic == "estimate":
                assert (message.publish_time, message.log_time) == (10**9, 2 * 10**9)
    assert topics == {"sensor/gps", "sensor/imu", "sensor/speed", "tick", "estimate", "health"}


def test_sensors_are_matched_by_name_not_by_number(tmp_path):
    readings = readings_of(LAYOUT, 200)
    path = written(tmp_path / "run.mcap", readings)
    other = layout_of("speed", "gps", payload=2)
    log = McapLog(path, other)
    found = joined(log)
    kept = readings[np.isin(readings["sensor"], [TICK, 0, 2])]
    assert found["sensor"].tolist() == [{TICK: TICK, 0: 1, 2: 0}[int(s)] for s in kept["sensor"]]
    assert found["z"].tobytes() == kept["z"][:, :2].tobytes()
    assert found["length"].tolist() == kept["length"].tolist()
    unknown = int(np.sum(readings["sensor"] == 1))
    assert log.refusals.counts == {Verdict.UNKNOWN_SENSOR: unknown}
    assert "'imu'" in log.refusals.first[Verdict.UNKNOWN_SENSOR]

    plain = McapLog(written(tmp_path / "j.mcap", readings, packed=False, json_readings=True), other)
    assert joined(plain).tobytes() == found.tobytes()
    assert plain.refusals.counts == log.refusals.counts


def test_json_that_somebody_else_recorded(tmp_path):
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("robot/sensor/gps", "json", 0)
        other = writer.register_channel("robot/camera", "json", 0)
        for k, text in enumerate(
            [
                '{"t": 1700000000.123456789, "z": [1, 2], "R": [0.5, 2]}',
                "{",
                "[]",
                '{"t": "noon"}',
                '{"t_ns": 7, "z": ["x"]}',
            ]
        ):
            writer.add_message(channel, log_time=50 + k, data=text.encode(), publish_time=0)
            writer.add_message(other, log_time=50 + k, data=b"{}", publish_time=0)
        writer.finish()
    log = open_log(path, LAYOUT)
    readings = joined(log)
    assert readings["t_ns"].tolist() == [1_700_000_000_123_456_789]
    assert readings["arrival_ns"].tolist() == [50]
    assert readings["flags"][0] & HAS_ARRIVAL
    assert readings["R"][0].diagonal().tolist() == [0.5, 2.0, 0.0]
    assert log.refusals.counts == {Verdict.MALFORMED: 4}


@pytest.fixture(scope="module")
def long_recording(tmp_path_factory):
    """A recording of several chunks, flushed after every block, and its readings."""
    readings = readings_of(LAYOUT, 2000)
    path = tmp_path_factory.mktemp("mcap") / "long.mcap"
    with McapWriter(path, LAYOUT) as writer:
        for start in range(0, 2000, 200):
            writer.readings(readings[start : start + 200])
            writer.flush()
    return path.read_bytes(), readings


@given(st.floats(0.0, 1.0))
def test_a_file_cut_anywhere_reads_up_to_its_last_whole_chunk(tmp_path_factory, long_recording, share):
    content, readings = long_recording
    path = tmp_path_factory.mktemp("cut") / "cut.mcap"
    path.write_bytes(content[: int(share * (len(content) - 1))])
    try:
        log = open_log(path, LAYOUT)
        found = joined(log)
    except LogError:
        assert share * len(content) < 2000
        return
    assert len(found) % 200 == 0
    assert found.tobytes() == readings[: len(found)].tobytes()
    assert len(log.warnings) == 1


def test_half_a_file_is_more_than_a_third_of_its_readings(tmp_path, long_recording):
    content, _ = long_recording
    path = tmp_path / "cut.mcap"
    path.write_bytes(content[: len(content) // 2])
    log = open_log(path, LAYOUT)
    assert 600 < len(joined(log)) < 1400
    assert "cut short or damaged after" in log.warnings[0]


def test_a_flipped_bit_is_seen_by_the_checksum(tmp_path, long_recording):
    content, _ = long_recording
    damaged = bytearray(content)
    damaged[len(content) // 2] ^= 4
    (tmp_path / "bad.mcap").write_bytes(damaged)
    log = open_log(tmp_path / "bad.mcap", LAYOUT)
    assert len(joined(log)) < 2000
    assert log.warnings


def test_what_is_no_mcap_is_an_error_with_its_remedy(tmp_path):
    (tmp_path / "x.mcap").write_bytes(b"nothing of the kind")
    with pytest.raises(LogError, match="fusiond import"):
        McapLog(tmp_path / "x.mcap", LAYOUT)
    with pytest.raises(LogError, match="name an existing"):
        open_log(tmp_path / "none.mcap", LAYOUT)
    with pytest.raises(LogError, match="name a writable place"):
        McapWriter(tmp_path / "none" / "x.mcap", LAYOUT)


class StuckWriter(McapWriter):
    """A disk that stands still until it is let go."""

    def __init__(self, path, layout):
        super().__init__(path, layout)
        self.let_go = threading.Event()
        self.entered = threading.Event()

    def readings(self, block):
        self.entered.set()
        assert self.let_go.wait(10.0)
        super().readings(block)


def test_a_full_queue_drops_counts_and_never_waits(tmp_path):
    writer = StuckWriter(tmp_path / "run.mcap", LAYOUT)
    background = BackgroundWriter(writer, capacity=3, flush_s=0.0)
    readings = readings_of(LAYOUT, 10, ticks=False)
    assert background.put_readings(readings[:1])
    assert writer.entered.wait(10.0)
    put = [background.put_readings(readings[k : k + 1]) for k in range(1, 7)]
    assert put == [True, True, True, False, False, False]
    assert background.dropped == {"readings": 3, "reports": 0, "messages": 0}
    writer.let_go.set()
    assert not background.close()
    log = McapLog(tmp_path / "run.mcap", LAYOUT)
    assert joined(log).tobytes() == readings[:4].tobytes()
    assert log.warnings == [
        "run.mcap: 3 readings were lost while it was recorded; a replay differs from that run"
    ]
    assert log.refusals.messages() == log.warnings
    file = McapFile(tmp_path / "run.mcap")
    list(file.walk())
    assert file.metadata["fusiond.end"]["dropped_readings"] == "3"
    assert file.metadata["fusiond.end"]["readings"] == "4"


def test_what_was_put_is_a_copy_and_all_of_it_is_written(tmp_path):
    readings = readings_of(LAYOUT, 500)
    background = BackgroundWriter(McapWriter(tmp_path / "run.mcap", LAYOUT))
    buffer = np.zeros(1, LAYOUT.reading)
    for k in range(len(readings)):
        buffer[0] = readings[k]
        assert background.put_readings(buffer)
    assert background.put_message("estimate", b"{}", 1, 2)
    assert background.close()
    assert not background.put_readings(buffer)
    assert joined(McapLog(tmp_path / "run.mcap", LAYOUT)).tobytes() == readings.tobytes()


def test_what_was_flushed_is_readable_before_the_file_is_closed(tmp_path):
    flushed = threading.Event()

    class Watched(McapWriter):
        def flush(self):
            super().flush()
            if self.counts["readings"]:
                flushed.set()

    background = BackgroundWriter(Watched(tmp_path / "run.mcap", LAYOUT), flush_s=0.01)
    readings = readings_of(LAYOUT, 50, ticks=False)
    background.put_readings(readings)
    assert flushed.wait(10.0)
    log = McapLog(tmp_path / "run.mcap", LAYOUT)
    assert joined(log).tobytes() == readings.tobytes()
    assert len(log.warnings) == 1
    background.close()


def test_a_disk_that_fails_ends_the_recording_and_says_so(tmp_path):
    class Full(McapWriter):
        def readings(self, block):
            raise OSError(28, "No space left on device")

    background = BackgroundWriter(Full(tmp_path / "run.mcap", LAYOUT), flush_s=0.0)
    readings = readings_of(LAYOUT, 5)
    background.put_readings(readings)
    assert not background.close()
    assert "No space left" in background.error
    assert background.dropped["readings"] == 5
