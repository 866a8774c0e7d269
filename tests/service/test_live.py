"""The daemon as its users meet it: real Zenoh, real processes."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import time

import numpy as np
import pytest
import zenoh

from fusiond.engine.records import HAS_SEQ
from fusiond.errors import ConnectionFailed
from fusiond.recording.digest import OutputDigest
from fusiond.recording.log import open_log
from fusiond.service import reading_record
from fusiond.service.ask import Refused
from fusiond.service.client import (
    ControlSubscriber,
    EstimateSubscriber,
    Player,
    SensorPublisher,
    TopicSubscriber,
    ask,
)
from fusiond.service.reading_json import encode_json
from fusiond.service.reading_record import encode_record
from fusiond.service.sessions import open_session, open_sessions, session_options

WAIT_S = 20.0


@pytest.fixture
def stream(assembly):
    """Two seconds of accelerometer at 100 Hz and ultrasonic at 50 Hz, from now on, numbered."""
    rng = np.random.default_rng(0)
    base_ns, layout = time.time_ns(), assembly.layout
    readings = np.zeros(300, layout.reading)
    for k, reading in enumerate(readings):
        is_range = k % 3 == 2
        reading["sensor"] = layout.numbers["ultrasonic" if is_range else "accelerometer"]
        reading["t_ns"] = base_ns + (k // 3) * 20_000_000 + (k % 3) * 10_000_000 - is_range * 5_000_000
        reading["z"][0] = rng.normal(1.0 if is_range else 0.0, 0.01)
        reading["length"], reading["flags"], reading["seq"] = (
            1,
            HAS_SEQ,
            k // 3 if is_range else k // 3 * 2 + k % 3,
        )
    return readings


def play(daemon, readings, layout):
    with Player("bench", layout, daemon.endpoint, speed=float("inf"), most_hz=2000.0) as player:
        player.wait_until_heard()
        player.play(readings)
        return daemon.status_when(lambda status: status["readings"] == len(readings))


@pytest.mark.parametrize("mode", ["peer", "router"])
@pytest.mark.parametrize("encoding", ["json", "record"])
def test_one_endpoint_serves_sensors_consumers_and_questions(start, mode, encoding):
    daemon = start(extra=f'mode = "{mode}"\nformat = "{encoding}"\n')
    with (
        EstimateSubscriber("bench", daemon.endpoint) as estimates,
        ControlSubscriber("bench", daemon.endpoint) as commands,
        TopicSubscriber("bench", "health", daemon.endpoint) as health,
        SensorPublisher("bench", "ultrasonic", daemon.endpoint, encoding=encoding) as sensor,
    ):
        sensor.wait_until_heard()
        t_ns = time.time_ns()
        sensor.publish([0.25], t_ns)
        estimate, command = estimates.next(WAIT_S), commands.next(WAIT_S)
        assert estimate is not None
        assert command is not None
        assert (estimate["t_ns"], estimate["seq"], estimate["resets"]) == (t_ns, 1, 0)
        assert estimate["health"] == command["level"] == "nominal"
        position = estimate["state"]["position"] if encoding == "json" else estimate["state"][0]
        assert position == pytest.approx(0.25, abs=0.01)
        assert command["valid"] is True
        status = daemon.status()
        assert status["mode"] == mode
        assert status["endpoints"] == [daemon.endpoint]
        assert status["sensors"]["ultrasonic"]["used"] == 1
        assert status["epoch"] == estimate["epoch"] == command["epoch"]
        message = health.next(WAIT_S)
        assert message is not None
        assert set(message["sensors"]) >= {"accelerometer", "ultrasonic"}


def test_as_a_client_it_works_through_somebodys_router(start):
    router = open_sessions("router", ["tcp/127.0.0.1:0"], [])
    try:
        (endpoint,) = router.endpoints
        daemon = start(extra='mode = "client"\n', arguments=(f"connect={endpoint}",))
        with (
            EstimateSubscriber("bench", endpoint) as estimates,
            SensorPublisher("bench", "ultrasonic", endpoint) as sensor,
        ):
            sensor.wait_until_heard()
            sensor.publish([0.25])
            assert estimates.next(WAIT_S) is not None
            assert ask("bench", "status", endpoint)["sensors"]["ultrasonic"]["used"] == 1
        assert daemon.terminate() == 0
    finally:
        router.close()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_within_a_second_while_readings_come(start, number):
    daemon = start()
    with SensorPublisher("bench", "ultrasonic", daemon.endpoint, encoding="record") as sensor:
        sensor.wait_until_heard()
        for k in range(2000):
            sensor.publish([0.25], 10**18 + k * 1_000_000)
        daemon.process.send_signal(number)
        assert daemon.process.wait(timeout=1.0) == 0


def test_an_endpoint_in_use_is_told_with_the_remedy(start):
    daemon = start()
    with pytest.raises(ConnectionFailed, match=r"in use; stop the other daemon, choose --listen"):
        open_sessions("peer", [daemon.endpoint], [])


def test_nobody_there_is_told_with_the_remedy():
    with pytest.raises(
        ConnectionFailed, match=r"connect tcp/127\.0\.0\.1:1: nobody answered within 0 s; start"
    ):
        open_session(session_options("client", connect=["tcp/127.0.0.1:1"]), timeout_s=0.0)


def test_bad_payloads_are_counted_by_reason_and_a_good_one_still_counts(start):
    daemon = start()
    rng = random.Random(0)
    with (
        EstimateSubscriber("bench", daemon.endpoint) as estimates,
        SensorPublisher("bench", "ultrasonic", daemon.endpoint) as sensor,
    ):
        sensor.wait_until_heard()
        key, session = sensor.key, sensor.session
        record = encode_record([0.5], 0, 0)
        for _ in range(200):
            session.put(key, rng.randbytes(rng.randrange(200)), encoding="application/json")
            flipped = bytearray(record)
            flipped[24 + rng.randrange(8)] ^= 1 << rng.randrange(8)
            session.put(key, bytes(flipped), encoding=reading_record.ENCODING)
        session.put(key, b"[" * 1_000_000, encoding="application/json")
        session.put(key + "x", encode_json([0.5], 0), encoding="application/json")
        status = daemon.status_when(lambda s: sum(s["refused"].values()) >= 402)
        assert status["refused"] == {"unknown_sensor": 1, "bad_crc": 200, "malformed": 201}
        assert status["sensors"]["ultrasonic"]["refused"] == {"bad_crc": 200, "malformed": 201}
        sensor.publish([0.5])
        assert estimates.next(WAIT_S)["health"] == "nominal"


def test_losses_show_as_gaps(start):
    daemon = start()
    with SensorPublisher("bench", "ultrasonic", daemon.endpoint) as sensor:
        sensor.wait_until_heard()
        for seq in (0, 1, 5, 6):
            sensor.seq = seq
            sensor.publish([0.5])
        status = daemon.status_when(lambda s: s["readings"] == 4)
        assert status["sensors"]["ultrasonic"]["lost"] == 3


def test_a_reset_is_done_once_for_each_idempotency_key(start):
    daemon = start()
    with (
        EstimateSubscriber("bench", daemon.endpoint) as estimates,
        TopicSubscriber("bench", "event", daemon.endpoint) as events,
        SensorPublisher("bench", "ultrasonic", daemon.endpoint) as sensor,
    ):
        sensor.wait_until_heard()
        sensor.publish([0.5])
        before = estimates.next(WAIT_S)
        assert (before["resets"], before["jump"]) == (0, {})
        first = ask("bench", "command/reset", daemon.endpoint, fields={"id": "a"})
        again = ask("bench", "command/reset", daemon.endpoint, fields={"id": "a"})
        assert first == {"done": "reset", "resets": 1}
        assert again == first | {"repeated": True}
        assert daemon.status()["service"] == "invalid"
        event = next(message for message in events if "reset" in message.content)
        sensor.publish([0.7])
        after = estimates.next(WAIT_S)
        assert (after["resets"], after["health"]) == (1, "nominal")
        assert after["jump"] == {name: pytest.approx(-before["state"][name]) for name in before["state"]}
        assert event["reset"] == {"resets": 1, "jump": after["jump"]}


def test_a_question_that_means_nothing_is_refused(start):
    daemon = start()
    with pytest.raises(Refused) as refused:
        ask("bench", "command/dance", daemon.endpoint)
    assert refused.value.code == "unknown"
    session = open_session(session_options("client", connect=[daemon.endpoint]))
    try:
        (reply,) = session.get("fusiond/bench/status", payload=b"[1, 2", timeout=WAIT_S)
        assert json.loads(reply.err.payload.to_bytes())["code"] == "malformed"
    finally:
        session.close()


def test_the_token_says_that_it_takes_readings(start):
    daemon = start()
    session = open_session(session_options("client", connect=[daemon.endpoint]))
    try:
        tokens = zenoh.handlers.FifoChannel(16)
        found = [
            str(r.ok.key_expr)
            for r in session.liveliness().get("fusiond/bench/alive/**", tokens, timeout=WAIT_S)
        ]
        assert len(found) == 1
        assert found[0].startswith("fusiond/bench/alive/fusion/")
    finally:
        session.close()


def test_silence_becomes_dead_reckoning_and_invalid_by_ticks_alone(start):
    """With nothing more to hear, time still passes: each level is reached and told as an event."""
    daemon = start(extra="[health]\ndead_reckoning_s = 0.7\ninvalid_s = 1.0\n")
    with (
        EstimateSubscriber("bench", daemon.endpoint) as estimates,
        TopicSubscriber("bench", "event", daemon.endpoint) as events,
        SensorPublisher("bench", "ultrasonic", daemon.endpoint) as sensor,
    ):
        sensor.wait_until_heard()
        sensor.publish([0.5])
        told = [events.next(WAIT_S).content for _ in range(5)]
        assert [(one["sensor"], one["to"]) for one in told] == [
            (None, "nominal"),
            ("ultrasonic", "silent"),
            (None, "degraded"),
            (None, "dead_reckoning"),
            (None, "invalid"),
        ]
        widths = []
        while (estimate := estimates.next(WAIT_S))["health"] != "invalid":
            widths.append(estimate["std"]["position"])
        assert widths == sorted(widths)
        assert len(widths) > 2


def test_a_report_goes_out_where_somebody_listens(start):
    daemon = start()
    with (
        TopicSubscriber("bench", "report/ultrasonic", daemon.endpoint) as reports,
        SensorPublisher("bench", "ultrasonic", daemon.endpoint) as sensor,
    ):
        sensor.wait_until_heard()
        report, deadline = None, time.monotonic() + WAIT_S
        while report is None and time.monotonic() < deadline:
            sensor.publish([1000.0])
            report = reports.next(0.1)
        assert report["verdict"] == "out_of_range"
        assert report["z"] == [1000.0]


def test_readings_out_of_order_over_the_wire_end_in_the_same_bits(start, stream, assembly):
    """Shuffled within the horizon, the same readings leave the same state as in order."""
    shuffled = stream.copy()
    rng = np.random.default_rng(1)
    for first in range(1, 291, 10):
        shuffled[first : first + 10] = rng.permutation(shuffled[first : first + 10])
    in_order = play(start(), stream, assembly.layout)
    out_of_order = play(start(), shuffled, assembly.layout)
    assert in_order["state_sha256"] == out_of_order["state_sha256"]
    for sensor in ("accelerometer", "ultrasonic"):
        assert (out_of_order["sensors"][sensor]["lost"], out_of_order["sensors"][sensor]["rejected"]) == (
            0,
            0,
        )


def test_a_replay_of_its_own_recording_gives_the_same_reports(start, stream, assembly, tmp_path):
    record = tmp_path / "run.mcap"
    daemon = start(record=record)
    live = play(daemon, stream, assembly.layout)
    assert daemon.terminate() == 0
    engine, replayed = assembly.engine(), OutputDigest()
    for readings in open_log(record, assembly.layout):
        replayed.update(engine.process(readings))
    assert engine.state_sha256() == live["state_sha256"]
    assert replayed.hexdigest() == digest_of_reports(record, assembly)


def digest_of_reports(record, assembly) -> str:
    """Hash over the reports that the daemon itself recorded."""
    from mcap.reader import make_reader

    digest = OutputDigest()
    with record.open("rb") as file:
        for _, _, message in make_reader(file).iter_messages(topics=["reports"]):
            digest.update(np.frombuffer(message.data, assembly.layout.report))
    return digest.hexdigest()


def test_a_sensor_in_ten_lines_works(start):
    daemon = start()
    program = f"""
from fusiond.service.client import SensorPublisher
with SensorPublisher("bench", "ultrasonic", "{daemon.endpoint}") as sensor:
    sensor.wait_until_heard()
    sensor.publish([0.5])
"""
    import sys

    subprocess.run([sys.executable, "-c", program], check=True, timeout=WAIT_S)
    assert daemon.status_when(lambda s: s["readings"] == 1)["sensors"]["ultrasonic"]["used"] == 1


def test_the_epoch_grows_from_one_start_to_the_next(start):
    assert start().status()["epoch"] < start().status()["epoch"]
