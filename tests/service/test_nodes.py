"""Sensor nodes and their center: what goes over the wire is exact, and a node that dies takes nothing with it."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
import zenoh

from fusiond.assembly.assembly import assemble
from fusiond.assembly.resolve import resolve
from fusiond.config import Config, parse
from fusiond.engine.records import HAS_R
from fusiond.errors import ConfigError
from fusiond.models.catalogue import PROCESSES, SENSORS
from fusiond.numerics.kernel import interpreted
from fusiond.recording.log import open_log
from fusiond.recording.replay import replay
from fusiond.service import output_record, reading_record, roles
from fusiond.service.client import SensorPublisher, ask
from fusiond.service.lease import Lease
from fusiond.service.sessions import open_session, session_options
from fusiond.service.settings import settings_of
from fusiond.service.state_path import StatePath
from fusiond.service.tracklet_outputs import TrackletOutputs
from fusiond.service.tracklets import Tracklets, linearised
from fusiond.service.wire import Decoder
from fusiond.simulation.registry import simulate
from fusiond.types import Verdict
from tests.service.conftest import end
from tools.pages.trials import records

PROJECT = Path(__file__).resolve().parents[2]
FILE = PROJECT / "configs" / "two_nodes.toml"
TEXT = FILE.read_text(encoding="utf-8")
NODES = {"left": "y1", "right": "y2"}
DEADLINE_S = 60.0
STEP_NS = 100_000_000


def part(text: str, role: str | None):
    """One machine's part of a configuration text."""
    return assemble(roles.part_of(roles.cast(parse(text, "two_nodes"), role), PROJECT))


def decoded(center, puts):
    """What the center makes of (sensor name, encoding, payload)."""
    decoder = Decoder(center.layout)
    decoder.begin()
    for name, encoding, payload in puts:
        decoder.add(center.layout.numbers[name], 0, encoding, payload)
    readings = decoder.readings().copy()
    assert decoder.refusals.counts == {}
    return readings


def sent(node, given, epoch=1):
    """The puts of a node that takes these readings, one after the other."""
    engine, tracklets = node.engine(), Tracklets(node.resolved, node.layout, epoch)
    found = []
    for reading in given:
        batch = reading.reshape(1)
        found += tracklets.puts(batch, engine.process(batch))
    return [(node.layout.sensors[number].name, encoding, payload) for number, encoding, payload in found]


def test_the_center_is_the_centralized_filter_whatever_is_lost_or_late():
    """A third of the tracklets lost, the rest in any order within 0.5 s: as if all had been heard directly."""
    rng = np.random.default_rng(0)
    alone, center = part(TEXT, None), part(TEXT, "center")
    simulation = simulate("constant_velocity", 0, 20.0, R=(0.01, 0.04))
    puts = [
        put
        for node in NODES
        for put in sent(part(TEXT, node), records(part(TEXT, node).layout, simulation.readings))
    ]
    given = decoded(center, puts)
    given = given[rng.random(len(given)) > 1.0 / 3.0]
    given = given[np.argsort(given["t_ns"] + rng.uniform(0.0, 5.0 * STEP_NS, len(given)), kind="stable")]

    direct = np.zeros(len(given), alone.layout.reading)
    for field in ("t_ns", "sensor", "seq", "flags"):
        direct[field] = given[field]
    direct["length"], direct["z"][:, 0] = 1, given["z"][:, 0]
    fused, reference = center.engine(), alone.engine()
    reports, expected = fused.process(given), reference.process(direct)

    assert (reports["action"] == expected["action"]).all()
    assert (reports["action"] > 0).any(), "nothing came late"
    assert (reports["verdict"] == Verdict.USED).all()
    for field in ("x", "std", "nis"):
        assert np.allclose(reports[field], expected[field], rtol=1e-9, atol=1e-12)
    assert np.allclose(fused.covariance(), reference.covariance(), rtol=1e-9, atol=0.0)


def test_a_node_that_starts_anew_far_from_its_prior_does_no_harm():
    """The position has moved 50 m off the configured start when the node is born: its prior is never sent."""
    node, center = part(TEXT, "left"), part(TEXT, "center")
    late = np.zeros(3, node.layout.reading)
    late["t_ns"], late["length"], late["z"][:, 0] = STEP_NS * np.arange(3), 1, 50.0
    (first, *_) = decoded(center, sent(node, late))
    prior = np.array([50.0, 0.0])
    h, H = look(center, first, prior)
    assert h[0] == pytest.approx(50.0)
    assert H[0].tolist() == [1.0, 0.0]


def look(center, reading, x):
    """What the center expects of a tracklet at x, and how that depends on x."""
    sensor = center.resolved.sensors[int(reading["sensor"])]
    size = len(sensor.model.channels)
    h, H = np.zeros(size), np.zeros((size, len(x)))
    p = np.array(sensor.model.parameters)
    interpreted(sensor.module.observe)(x, reading["z"], np.arange(len(x)), p, h, H)
    return h, H


def test_the_numbers_of_a_node_that_starts_anew_go_on_growing():
    node = part(TEXT, "left")
    given = np.zeros(2, node.layout.reading)
    given["t_ns"], given["length"] = [0, STEP_NS], 1
    center = part(TEXT, "center")
    before, after = (decoded(center, sent(node, given, epoch))["seq"] for epoch in (1, 2))
    assert before[1] == before[0] + 1
    assert after[0] > before[1]


def test_a_repeated_value_is_repeated_at_the_center_too():
    """A receiver that repeats its fix between fixes is no evidence there either, and not silent."""
    text = TEXT.replace("[sensor.y1]\n", '[sensor.y1]\nrepeats = "held"\n')
    node, center = part(text, "left"), part(text, "center")
    given = np.zeros(3, node.layout.reading)
    given["t_ns"], given["length"], given["z"][:, 0] = STEP_NS * np.arange(3), 1, [0.5, 0.5, 0.6]
    reports = center.engine().process(decoded(center, sent(node, given)))
    assert [Verdict(int(v)) for v in reports["verdict"]] == [Verdict.USED, Verdict.HELD, Verdict.USED]


def test_what_a_node_refuses_never_leaves_it():
    text = TEXT.replace("[sensor.y1]\n", "[sensor.y1]\nvalid = { y = [-9.0, 9.0] }\n")
    node = part(text, "left")
    given = np.zeros(3, node.layout.reading)
    given["t_ns"], given["length"], given["z"][:, 0] = (
        STEP_NS * np.arange(3),
        [1, 1, 2],
        [99.0, math.nan, 0.0],
    )
    assert sent(node, given) == []
    assert part(text, "center").design["upper"][0, 0, 0] == 9.0


@pytest.mark.parametrize("R", [[[0.04]], [[0.5]]])
def test_the_covariance_that_a_reading_brought_goes_with_it(R):
    node, center = part(TEXT, "left"), part(TEXT, "center")
    given = np.zeros(1, node.layout.reading)
    given["length"], given["flags"], given["R"][0] = 1, HAS_R, R
    (reading,) = decoded(center, sent(node, given))
    assert reading["flags"] & HAS_R
    assert center.engine().process(reading.reshape(1))["R_used"][0, 0] == R[0][0]


PLANE = """
name = "plane"
[model]
kind = "planar_robot"
acceleration_noise_m_s2_sqrt_hz = 0.2
yaw_acceleration_noise_rad_s2_sqrt_hz = 0.1
gyro_bias_noise_rad_s_sqrt_s = 0.0
[initial]
state = {}
std = { x_m = 1.0, y_m = 1.0, yaw_rad = 1.0, speed_m_s = 1.0, yaw_rate_rad_s = 1.0, gyro_bias_rad_s = 1.0 }
[sensor.compass]
kind = "heading"
rate_hz = 10.0
noise_std = { yaw_rad = 0.1 }
[sensor.gps]
kind = "gps_position"
lever_forward_m = 2.0
rate_hz = 10.0
noise_std = { x_m = 0.5, y_m = 0.5 }
[sensor.gyro]
kind = "yaw_rate"
rate_hz = 10.0
noise_std = { yaw_rate_rad_s = 0.1 }
[service]
nodes = { mast = ["gps"], wrist = ["gyro"] }
"""


def test_a_tracklet_stands_for_its_sensor_near_where_it_was_taken_also_across_the_angles_edge():
    """Linearised at yaw 3.1, asked at yaw -3.1, 0.08 rad on: the antenna's place to the second order of that."""
    config = parse(PLANE, "plane")
    alone = resolve(config, PROJECT)
    center = part(PLANE, "center")
    (gps,) = [sensor for sensor in alone.sensors if sensor.name == "gps"]
    names = [slot.name for slot in alone.process.states]
    at = np.array([names.index(name) for name in gps.model.reads])
    there = np.array([3.0, 4.0, 3.1, 5.0, 0.1, 0.0])
    here = np.array([3.1, 3.9, 3.1 + 0.083 - 2.0 * math.pi, 5.0, 0.1, 0.0])
    numbers = linearised(gps, at, np.array([1.0, 2.0]), there)
    (tracklet,) = [sensor for sensor in center.resolved.sensors if sensor.name == "gps"]
    assert len(numbers) == len(tracklet.model.channels)
    h, H = np.zeros(len(numbers)), np.zeros((len(numbers), 6))
    p = np.array(tracklet.model.parameters)
    interpreted(tracklet.module.observe)(here, np.array(numbers), at, p, h, H)
    exact, slope = np.zeros(2), np.zeros((2, 6))
    own = np.array(gps.model.parameters)
    interpreted(gps.module.observe)(here, np.zeros(2), at, own, exact, slope)
    assert np.abs(h[:2] - exact).max() < 2.0 * 0.083**2
    assert np.abs(H[:2] - slope).max() < 2.0 * 0.083


def test_a_node_need_not_see_what_its_sensors_do_not_depend_on():
    """The gyro's model is linear, so that the wrist need see nothing; the antenna's place turns with yaw."""
    wrist = roles.part_of(roles.cast(parse(PLANE, "plane"), "wrist"), PROJECT)
    mast = roles.part_of(roles.cast(parse(PLANE, "plane"), "mast"), PROJECT)
    assert set(wrist.filter.accept_unobservable) >= {"x", "y", "yaw", "speed"}
    assert "yaw" not in mast.filter.accept_unobservable
    assert "gyro_bias" in mast.filter.accept_unobservable
    assert part(PLANE, "mast").layout.sensors[0].name == "gps"


def test_a_late_reading_is_linearised_where_the_filter_was_then():
    path = StatePath(np.array([False, True]))
    path.note(0, np.array([0.0, 3.1]))
    path.note(100, np.array([10.0, -3.1]))
    x = path.at(50)
    assert x[0] == pytest.approx(5.0)
    assert abs((x[1] - math.pi + math.pi) % (2.0 * math.pi) - math.pi) < 1e-12
    assert path.at(-1)[0] == 0.0
    assert path.at(101)[0] == 10.0
    path.note(-50, np.array([7.0, 0.0]))
    assert path.at(0)[0] == 7.0, "time went back: what was before it counts no more"


def test_a_sensor_that_bends_is_linearised_at_the_centers_estimate():
    """A node born far from its configured start would send a wrong H: it waits until it hears where it is."""
    config = roles.part_of(roles.cast(parse(PLANE, "plane"), "mast"), PROJECT)
    node = assemble(config, PROJECT)
    tracklets = Tracklets(node.resolved, node.layout, 1)
    reading, report = np.zeros(1, node.layout.reading), np.zeros(1, node.layout.report)
    reading["length"], report["t_ns"], report["state_t_ns"] = 2, 10**9, 10**9
    report["x"][0] = [3.0, 4.0, 0.0, 5.0, 0.0, 0.0]
    at_yaw = -1

    assert tracklets.puts(reading, report) == []
    tracklets.center.health({"service": "nominal"})
    assert tracklets.puts(reading, report) == [], "the center knows where it is, and has not told yet"
    assert tracklets.withheld == {0: 2}

    state = {"x": 300.0, "y": 0.0, "yaw": 1.5, "speed": 5.0, "yaw_rate": 0.0, "gyro_bias": 0.0}
    tracklets.center.estimate({"health": "nominal", "state": state, "t_ns": 10**9 - 10**7})
    assert numbers_of(tracklets.puts(reading, report))[at_yaw] == 1.5
    tracklets.center.estimate({"health": "nominal", "state": list(state.values()), "t_ns": 10**9 + 10**7})
    assert numbers_of(tracklets.puts(reading, report))[at_yaw] == 1.5

    tracklets.center.estimate({"health": "invalid", "state": {}, "t_ns": 0})
    assert numbers_of(tracklets.puts(reading, report))[at_yaw] == 0.0, (
        "nobody knows better than the node itself"
    )


@pytest.mark.parametrize("packed", [False, True])
def test_a_node_hears_the_center_over_the_wire(packed):
    """Its estimate as JSON or as a record; before it, nothing of a sensor that bends goes out."""
    config = roles.part_of(roles.cast(parse(PLANE, "plane"), "mast"), PROJECT)
    node = assemble(config, PROJECT)
    reading, report = np.zeros(1, node.layout.reading), np.zeros(1, node.layout.report)
    reading["length"], report["t_ns"], report["state_t_ns"] = 2, 10**9, 10**9
    x = (300.0, 0.0, 1.5, 5.0, 0.0, 0.0)
    content = {
        "health": "nominal",
        "t_ns": 10**9,
        "state": dict(zip([s.name for s in node.layout.states], x, strict=True)),
    }
    payload, encoding = json.dumps(content).encode(), "application/json"
    if packed:
        payload = output_record.encode_estimate(10**9, 1, 1, 0, x, x, x, 0)
        encoding = output_record.ESTIMATE_ENCODING
    with open_session(session_options("peer", listen=["tcp/127.0.0.1:0"])) as session:
        keys = settings_of(node.config, node.layout, (), ()).sends
        assert keys == {"gps": "fusiond/plane/sensor/gps"}
        center = session.declare_subscriber(keys["gps"], zenoh.handlers.RingChannel(8))
        outputs = TrackletOutputs(session, node, keys, Lease(1))
        outputs.publish(reading, report)
        assert outputs.withheld == {"gps": 1}
        session.put("fusiond/plane/estimate", b"nonsense")
        outputs.publish(reading, report)
        assert outputs.withheld == {"gps": 2}
        session.put("fusiond/plane/estimate", payload, encoding=encoding)
        outputs.publish(reading, report)
        assert outputs.withheld == {"gps": 2}
        sample = center.recv()
        assert numbers_of([(0, str(sample.encoding), sample.payload.to_bytes())])[-1] == 1.5
        assert center.try_recv() is None


def numbers_of(puts):
    """The numbers of the one record in the one put."""
    ((_, encoding, payload),) = puts
    assert encoding == reading_record.ENCODING
    return np.frombuffer(payload[reading_record.HEADER.size : -reading_record.CRC.size])


def test_a_linear_sensor_waits_for_nobody():
    node = part(TEXT, "left")
    assert Tracklets(node.resolved, node.layout, 1).bent == frozenset()


MISTAKES = {
    "unknown sensor": ('["y2"]', '["y3"]', r"service\.nodes\.right: `y3` is no sensor; choose from y1, y2"),
    "shared": ('["y2"]', '["y1"]', r"service\.nodes\.right: `y1` is at `left` too; leave it to one node"),
    "nothing": ('["y2"]', "[]", r"service\.nodes\.right: needs another name .* at least one sensor"),
    "reserved": ("right =", "center =", r"service\.nodes\.center: needs another name than `center`"),
    "no rate": (
        "rate_hz = 10.0",
        "",
        r"sensor\.y1: has no rate_hz, so that nobody would notice when node `left`",
    ),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_an_operators_mistake_is_named_with_its_remedy(case):
    old, new, message = MISTAKES[case]
    assert old in TEXT
    with pytest.raises(ConfigError, match=message):
        part(TEXT.replace(old, new), "center")


def test_a_center_without_nodes_is_refused():
    with pytest.raises(ConfigError, match=r"service\.nodes: names no node; add them, or leave role"):
        refuse(TEXT[: TEXT.index("nodes = {")] + 'role = "center"\n')


def refuse(text: str) -> None:
    roles.part_of(parse(text, "two_nodes"), PROJECT)


def test_a_part_that_is_none_is_refused():
    with pytest.raises(ConfigError, match=r"--as lefft: no such node; did you mean `left`\?"):
        roles.cast(parse(TEXT, "two_nodes"), "lefft")
    with pytest.raises(ConfigError, match=r"service\.node: is missing; choose from left, right"):
        refuse(TEXT + 'role = "node"\n')


def test_a_state_that_is_no_vector_is_not_shared():
    config = roles.cast(parse_flight(), "tail")
    with pytest.raises(ConfigError, match=r"service\.role: the state of this model is no vector"):
        roles.part_of(config, PROJECT / "configs")


def parse_flight() -> Config:
    text = (PROJECT / "configs" / "flight.toml").read_text(encoding="utf-8")
    return parse(text + '\n[service]\nnodes = { tail = ["gnss_position"] }\n', "flight")


def test_every_model_of_a_built_in_sensor_can_be_a_tracklet():
    """Its own description has what a tracklet's needs; only a state that is no vector stands against it."""
    process = PROCESSES["planar_robot"].describe(acceleration_noise_m_s2_sqrt_hz=1.0,
        yaw_acceleration_noise_rad_s2_sqrt_hz=1.0, gyro_bias_noise_rad_s_sqrt_s=1.0)  # fmt: skip
    own = SENSORS["beacon_range"].describe(process, beacons=[[3.0, 1.0, 2.0]])
    sensor = SENSORS["tracklet"].describe(
        process, channels=[slot.name for slot in own.channels[: own.dof]], reads=list(own.reads),
        H=[[1.0] * len(own.reads)],
    )  # fmt: skip
    assert sensor.dof == own.dof
    assert len(sensor.channels) == 2 * own.dof + own.dof * len(own.reads) + len(own.reads)


@dataclass
class Machine:
    """One process of `fusiond run FILE --as PART`."""

    process: subprocess.Popen[str]
    endpoint: str
    said: Path

    def told(self, text: str) -> bool:
        return text in self.said.read_text(encoding="utf-8")


@pytest.fixture
def machine(tmp_path):
    """Start machines: `machine("left", "--connect", ENDPOINT)`; ended by their pids."""
    with ExitStack() as stack:

        def run(role: str, *options: str) -> Machine:
            said = tmp_path / f"{role}{len(list(tmp_path.glob('*.log')))}.log"
            errors = stack.enter_context(said.open("w", encoding="utf-8"))
            command = [sys.executable, "-m", "fusiond.cli", "run", str(FILE), "--as", role]
            process = stack.enter_context(
                subprocess.Popen(
                    [*command, "--listen", "tcp/127.0.0.1:0", *options],
                    stdout=subprocess.PIPE,
                    stderr=errors,
                    text=True,
                    cwd=PROJECT,
                )
            )
            stack.callback(end, process)
            assert process.stdout is not None
            words = process.stdout.readline().split()
            assert words[:1] == ["ready"], said.read_text(encoding="utf-8")
            return Machine(process, words[1], said)

        yield run


class Drive:
    """A point that moves at 1 m/s, measured by both sensors without noise.

    The stamps are those of the clock when it began, ten a second, however fast they are sent.
    """

    def __init__(self, center: Machine, session) -> None:
        self.center, self.session, self.k = center, session, 0
        self.start_ns = time.time_ns() // STEP_NS * STEP_NS
        self.sensors: dict[str, SensorPublisher] = {}

    def until(self, fulfilled):
        """Send step after step until the center's status fulfils a condition; that status."""
        deadline = time.monotonic() + DEADLINE_S
        while True:
            for sensor in self.sensors.values():
                sensor.publish([0.1 * self.k], self.start_ns + self.k * STEP_NS)
            self.k += 1
            status = ask("two_nodes", "status", session=self.session)
            if fulfilled(status):
                return status
            assert time.monotonic() < deadline, f"never came true; last: {status}"


def test_a_center_goes_on_without_a_killed_node_and_takes_it_back(machine, tmp_path):
    """Three processes; one node dies by SIGKILL and returns. The recording replays to the center's own bits."""
    run = tmp_path / "center.mcap"
    center = machine("center", "--record", str(run))
    left, right = (machine(node, "--connect", center.endpoint) for node in NODES)
    with ExitStack() as stack:
        session = stack.enter_context(open_session(session_options("client", connect=[center.endpoint])))
        drive = Drive(center, session)

        def attach(node: str, endpoint: str) -> None:
            space = f"fusiond/two_nodes/node/{node}"
            sensor = SensorPublisher("two_nodes", NODES[node], endpoint, namespace=space)
            drive.sensors[node] = stack.enter_context(sensor)
            sensor.wait_until_heard()

        # GIVEN two nodes that the center hears
        attach("left", left.endpoint)
        attach("right", right.endpoint)
        status = drive.until(lambda s: all(one["used"] > 5 for one in s["sensors"].values()))
        assert (status["role"], status["nodes"]) == ("center", {"left": "healthy", "right": "healthy"})
        mine = ask("two_nodes/node/left", "status", left.endpoint)
        assert (mine["role"], mine["service"]) == ("node", "nominal")
        assert mine["estimate"]["state"]["position"] == pytest.approx(0.1 * (drive.k - 1), abs=0.5)

        # WHEN the left one is killed THEN the center names it and goes on with the other
        left.process.kill()
        left.process.wait(DEADLINE_S)
        del drive.sensors["left"]
        status = drive.until(lambda s: s["nodes"]["left"] == "silent")
        assert status["nodes"]["right"] == "healthy"
        before = status["sensors"]
        status = drive.until(lambda s: s["sensors"]["y2"]["used"] >= before["y2"]["used"] + 5)
        assert status["service"] == "degraded"
        assert status["sensors"]["y1"]["used"] == before["y1"]["used"]
        assert status["estimate"]["state"]["position"] == pytest.approx(0.1 * drive.k, abs=0.3)
        assert center.told("node left: silent")
        assert center.told("node left, y1: silent (limit 0.3 s)")

        # WHEN it returns THEN it is used again
        left = machine("left", "--connect", center.endpoint)
        attach("left", left.endpoint)
        known = before["y1"]["used"]
        status = drive.until(lambda s: s["sensors"]["y1"]["used"] > known + 5 and s["service"] == "nominal")
        assert status["nodes"] == {"left": "healthy", "right": "healthy"}
        assert center.told("node left: back")
        assert status["refused"] == {}
        assert all(sensor["rejected"] == 0 for sensor in status["sensors"].values())

        # and the whole story replays to the same bits
        drive.sensors.clear()
        sha256 = settled(session)
    center.process.terminate()
    assert center.process.wait(DEADLINE_S) == 0
    assembly = roles.load(FILE, "center")
    engine = assembly.engine()
    replay(engine, open_log(run, assembly.layout))
    assert engine.state_sha256() == sha256


def settled(session) -> str:
    """The hash of the center's state once nothing is on its way any more: it ticks only while nothing comes."""
    deadline, last, ticks = time.monotonic() + DEADLINE_S, ("", 0), 0
    while time.monotonic() < deadline:
        status = ask("two_nodes", "status", session=session)
        now = (status["state_sha256"], status["readings"])
        if now != last:
            last, ticks = now, status["ticks"]
        elif status["ticks"] > ticks and status["queue"]["waiting"] == 0:
            return str(now[0])
    raise AssertionError("the state never came to rest")
