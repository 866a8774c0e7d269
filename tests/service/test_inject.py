"""The live relay: real Zenoh, the relay and the sensors as programs of their own, each ended by its pid.

The sensors know nothing of fusiond: one writes JSON, one packs records with `struct`.
"""

from __future__ import annotations

import json
import math
import queue
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import zenoh

from fusiond.service.sessions import open_session, open_sessions, session_options
from tests.service.conftest import DEADLINE_S, PROJECT, Start, end
from tests.service.inject_reader import read
from tools import inject

RAW, KEY = "raw/sonar", "fusiond/bench/sensor/ultrasonic"
RECORDS = "application/octet-stream;fusiond.reading.v1"
SENSOR = """
import json, struct, sys, threading, zlib, zenoh
endpoint, key, form = sys.argv[1:]
settings = {"mode": "client", "connect": {"endpoints": [endpoint]}, "scouting": {"multicast": {"enabled": False}}}
session = zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))
encoding = {"json": "application/json", "record": "application/octet-stream;fusiond.reading.v1"}[form]
publisher = session.declare_publisher(key, encoding=encoding, congestion_control=zenoh.CongestionControl.BLOCK)
heard = threading.Event()
note = zenoh.handlers.Callback(lambda status: status.matching and heard.set(), indirect=False)
listener = publisher.declare_matching_listener(note)
publisher.matching_status.matching or heard.wait(20)
print("heard", flush=True)
seq = 0
def one(k):
    t_ns, z, R = 1_700_000_000_000_000_001 + 20_000_000 * k, 0.1 + 0.001 * (k % 7), 1e-4
    if form == "json":
        return '{"seq": %d, "t": %d.%09d, "z": [%r], "R": [1.0e-4]}' % (k, t_ns // 10**9, t_ns % 10**9, z)
    body = struct.pack("<4sBBHQqdd", b"FUS1", 1, 1, 1, k, t_ns, z, R)
    return body + struct.pack("<I", zlib.crc32(body))
for line in sys.stdin:
    size, puts = map(int, line.split())
    for _ in range(puts):
        parts = [one(seq + k) for k in range(size)]
        seq += size
        joined = b"".join(parts) if form == "record" else parts[0] if size == 1 else "[" + ", ".join(parts) + "]"
        publisher.put(joined, attachment=b"note")
    print("sent", seq, flush=True)
session.close()
"""


@dataclass
class Scene:
    """A hub or daemon, the programs around it, and what arrives where the daemon listens."""

    endpoint: str
    stack: ExitStack
    heard: queue.Queue[zenoh.Sample] = field(default_factory=queue.Queue)
    relay: subprocess.Popen[str] | None = None
    sensor: subprocess.Popen[str] | None = None

    def __post_init__(self) -> None:
        session = self.stack.enter_context(open_session(session_options("client", connect=[self.endpoint])))
        session.declare_subscriber(KEY, zenoh.handlers.Callback(self.heard.put, indirect=False))

    def start(self, form: str, *options: str) -> None:
        """The relay first: the sensor waits until somebody hears it."""
        self.relay = self._run(
            "-m", "tools.inject", "relay", "--from", RAW, "--connect", self.endpoint, *options
        )
        assert self.relay.stdout is not None
        assert self.relay.stdout.readline() == f"ready {RAW} -> {KEY}\n", self.relay.communicate()[1]
        self.sensor = self._run("-c", SENSOR, self.endpoint, RAW, form)
        assert self.sensor.stdout is not None
        assert self.sensor.stdout.readline() == "heard\n"

    def publish(self, size: int, puts: int) -> list[zenoh.Sample]:
        """So many puts of so many readings each; what arrives of them."""
        self.publish_unheard(size, puts)
        return [self.heard.get(timeout=DEADLINE_S) for _ in range(puts)]

    def publish_unheard(self, size: int, puts: int) -> None:
        assert self.sensor is not None
        assert self.sensor.stdin is not None
        assert self.sensor.stdout is not None
        self.sensor.stdin.write(f"{size} {puts}\n")
        self.sensor.stdin.flush()
        assert self.sensor.stdout.readline().startswith("sent")

    def tell(self, *words: str) -> int:
        """A command of the tool, as an operator types it; its exit status."""
        return inject.main([*words, "--connect", self.endpoint])

    def counts(self, capsys: pytest.CaptureFixture[str]) -> dict[str, int]:
        """What the relay says it has passed on."""
        capsys.readouterr()
        assert self.tell("list", "--json") == 0
        (relay,) = json.loads(capsys.readouterr().out)["relays"]
        return dict(relay["counts"])

    def counts_when_heard(self, number: int, capsys: pytest.CaptureFixture[str]) -> dict[str, int]:
        """The same, once the relay has heard so many readings; fails after the deadline."""
        deadline = time.monotonic() + DEADLINE_S
        while (counts := self.counts(capsys))["heard"] < number:
            assert time.monotonic() < deadline, f"never came; last: {counts}"
        return counts

    def _run(self, *arguments: str) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [sys.executable, *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            text=True, cwd=PROJECT,
        )  # fmt: skip
        self.stack.enter_context(process)
        self.stack.callback(end, process)
        return process


@pytest.fixture
def scene_at() -> Iterator[Callable[[str], Scene]]:
    with ExitStack() as stack:
        yield lambda endpoint: Scene(endpoint, stack)


@pytest.fixture
def scene(scene_at: Callable[[str], Scene]) -> Iterator[Scene]:
    """A hub without a daemon: what arrives is looked at byte by byte."""
    hub = open_sessions("peer", ["tcp/127.0.0.1:0"], [])
    try:
        yield scene_at(hub.endpoints[0])
    finally:
        hub.close()


def readings(samples: list[zenoh.Sample]) -> list[dict[str, Any]]:
    return [one for sample in samples for one in read(sample)]


def values(samples: list[zenoh.Sample]) -> list[float]:
    return [one["z"][0] for one in readings(samples)]


def honest(first: int, count: int) -> list[float]:
    return [0.1 + 0.001 * (k % 7) for k in range(first, first + count)]


@pytest.mark.parametrize(("form", "encoding"), [("json", "application/json"), ("record", RECORDS)])
def test_a_fault_is_switched_on_and_off_and_nothing_else_changes(scene, form, encoding, capsys):
    """30 honest readings, 30 with 0.5 too much, 30 honest ones; stamps, seq, R, encoding, attachment as they were."""
    # GIVEN a sensor of another make and a relay in front of it
    scene.start(form, "--to", KEY)

    # WHEN nothing is set, a bias is, and is cleared
    before = scene.publish(1, 15) + scene.publish(3, 5)
    assert scene.tell("set", "ultrasonic.bias=0.5") == 0
    during = scene.publish(1, 15) + scene.publish(3, 5)
    assert scene.tell("clear", "ultrasonic.bias") == 0
    after = scene.publish(3, 10)

    # THEN only the values between differ
    assert values(before) == honest(0, 30)
    assert values(during) == [z + 0.5 for z in honest(30, 30)]
    assert values(after) == honest(60, 30)
    every = readings(before + during + after)
    assert [one["seq"] for one in every] == list(range(90))
    assert [one["t_ns"] for one in every] == [1_700_000_000_000_000_001 + 20_000_000 * k for k in range(90)]
    assert {tuple(one["R"]) for one in every} == {(1e-4,)}
    assert {str(sample.encoding) for sample in before + during + after} == {encoding}
    assert {bytes(sample.attachment) for sample in before + during + after} == {b"note"}
    assert scene.counts(capsys) == {"heard": 90, "sent": 90, "altered": 30, "withheld": 0, "unread": 0}


def test_puts_that_no_fault_meets_go_on_byte_for_byte(scene):
    """Blanks and digits of the sensor's own JSON included."""
    scene.start("json", "--to", KEY, "--inject", "ultrasonic.bias=1@3600")
    (sample,) = scene.publish(1, 1)
    assert sample.payload.to_bytes() == (b'{"seq": 0, "t": 1700000000.000000001, "z": [0.1], "R": [1.0e-4]}')


@pytest.mark.parametrize("form", ["json", "record"])
def test_what_is_withheld_leaves_a_gap_in_seq_and_the_rest_of_its_put(scene, form, capsys):
    """Broken: nothing arrives. Then the sensor is back with the number it would have had. NaN arrives as NaN."""
    scene.start(form, "--to", KEY)
    scene.publish(3, 2)
    assert scene.tell("set", "ultrasonic.broken@now") == 0
    scene.publish_unheard(3, 4)
    assert scene.counts_when_heard(18, capsys)["withheld"] == 12
    assert scene.heard.empty()
    assert scene.tell("clear") == 0
    assert [one["seq"] for one in readings(scene.publish(3, 1))] == [18, 19, 20]
    assert scene.tell("set", "ultrasonic.nan", "ultrasonic.intermittent=0.5") == 0
    scene.publish_unheard(3, 30)
    counts = scene.counts_when_heard(111, capsys)
    arrived: list[dict[str, Any]] = []
    while len(arrived) < counts["sent"] - 9:
        arrived += read(scene.heard.get(timeout=DEADLINE_S))
    assert scene.heard.empty()
    assert 20 < len(arrived) < 70
    assert all(math.isnan(one["z"][0]) for one in arrived)
    assert {one["seq"] for one in arrived} < set(range(21, 111))


def test_noise_is_multiplied_by_what_the_readings_bring(scene):
    """Without a configuration, R of the readings says how noisy the sensor is: 0.01, and 4 times that in all."""
    scene.start("record", "--to", KEY, "--seed", "3")
    scene.publish(3, 1)
    assert scene.tell("set", "ultrasonic.noise=4") == 0
    added = [a - b for a, b in zip(values(scene.publish(100, 4)), honest(3, 400), strict=True)]
    rms = math.sqrt(sum(one * one for one in added) / len(added))
    # 0.03873, within four standard deviations of the estimate from 400 draws.
    assert rms == pytest.approx(0.01 * math.sqrt(15.0), rel=4.0 / math.sqrt(800.0))


@pytest.mark.parametrize("form", ["json", "record"])
def test_the_daemon_is_none_the_wiser(start: Start, scene_at, form: str):
    """A real daemon behind the relay: every reading used, none lost or refused; what is no number is rejected."""
    # GIVEN a daemon, a relay that knows its configuration, and a sensor of another make
    daemon = start()
    scene = scene_at(daemon.endpoint)
    scene.start(form, "--config", str(daemon.config), "--sensor", "ultrasonic")

    def sensor() -> Any:
        return daemon.status()["sensors"]["ultrasonic"]

    # WHEN it is honest
    scene.publish(3, 20)
    daemon.status_when(lambda status: status["sensors"]["ultrasonic"]["used"] == 60)
    assert (sensor()["lost"], sensor()["rejected"], sensor()["refused"]) == (0, 0, {})

    # WHEN it is biased, THEN every reading is still a sound one of the same sensor
    assert scene.tell("set", "ultrasonic.bias=0.005") == 0
    scene.publish(3, 20)
    daemon.status_when(lambda status: sum(sensor()[what] for what in ("used", "rejected")) == 120)
    assert (sensor()["lost"], sensor()["late"], sensor()["refused"]) == (0, 0, {})

    # WHEN it sends what is not a number, THEN the daemon rejects it
    assert scene.tell("clear") == 0
    assert scene.tell("set", "ultrasonic.nan") == 0
    rejected = sensor()["rejected"]
    scene.publish(3, 20)
    daemon.status_when(lambda status: sensor()["rejected"] == rejected + 60)
    assert sensor()["refused"] == {}


def test_operators_mistakes_are_named(scene, capsys, tmp_path: Path):
    """Status 2 with what is there instead; 1 where nobody answers."""
    to = ("--to", KEY)
    assert scene.tell("list") == 1
    assert "no relay answers" in capsys.readouterr().err
    assert scene.tell("relay", "--from", "fusiond/**", *to) == 2
    assert "would hear itself" in capsys.readouterr().err
    assert scene.tell("relay", "--from", RAW, "--to", "fusiond/*") == 2
    assert "is many keys" in capsys.readouterr().err
    assert scene.tell("relay", "--from", RAW, *to, "--inject", "ultrasonic.bais=1@0") == 2
    assert "did you mean `bias`?" in capsys.readouterr().err
    assert scene.tell("relay", "--from", RAW, *to, "--inject", "ultrasonic.noise=4@0") == 2
    assert "the noise of ultrasonic is not known" in capsys.readouterr().err
    scene.start("json", *to)
    assert scene.tell("set", "ultrasonc.bias=1") == 2
    assert "no relay in front of `ultrasonc`; did you mean `ultrasonic`?" in capsys.readouterr().err
    scene.publish(1, 1)
    assert scene.tell("set", "ultrasonic.4.bias=1") == 2
    assert "no channel 4; ultrasonic has 0" in capsys.readouterr().err


def test_sigterm_ends_the_relay_with_an_account(scene):
    scene.start("json", "--to", KEY, "--inject", "ultrasonic.scale=2@0")
    scene.publish(1, 5)
    scene.relay.terminate()
    _, errors = scene.relay.communicate(timeout=DEADLINE_S)
    assert scene.relay.returncode == 0
    assert errors == "inject: ultrasonic: 5 heard, 5 sent, 5 altered, 0 withheld, 0 unread\n"
