"""Two daemons as their users meet them: one speaks, the other takes over when it is killed, hangs or is stopped."""

from __future__ import annotations

import json
import signal
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
import zenoh

from fusiond.assembly.assembly import load
from fusiond.engine.records import HAS_ARRIVAL, HAS_SEQ
from fusiond.errors import ConfigError, ConnectionFailed
from fusiond.service.client import (
    ControlSubscriber,
    EstimateSubscriber,
    SensorPublisher,
    TopicSubscriber,
    ask,
)
from fusiond.service.election import Member
from fusiond.service.members import token_of
from fusiond.service.sessions import join, open_session, session_options
from fusiond.service.settings import settings_of
from tests.service.conftest import CONFIG

WAIT_S = 30.0
STEP_NS = 20_000_000
OUT = ("estimate", "control", "health", "event", "pulse")
SHORT_NS = 300_000_000
PATIENT = "takeover_s = 20.0\n"
"""Only a token that goes counts: a machine that is busy makes nobody seem hung."""
LQG = """[control]
law = "lqg_integral"
rate_hz = 50.0
controls = ["force"]
units = ["n"]
states = ["position", "velocity"]
A = [[0.0, 1.0], [0.0, 0.0]]
B = [[0.0], [1.0]]
tracks = ["position"]
state_cost = { position = 2.0, velocity = 2.0 }
input_cost = { force = 1.0 }
integral_cost = { position = 0.5 }
reference = { position_m = 2.0 }
lowest = { force_n = -1.0 }
highest = { force_n = 1.0 }
"""
PD = CONFIG[CONFIG.index("[control]") : CONFIG.index("[history]")]
LAWS = {"pd": CONFIG, "lqg": CONFIG.replace(PD, LQG)}


def free_endpoints(count: int) -> list[str]:
    """Endpoints on ports that are free now."""
    with ExitStack() as stack:
        sockets = [stack.enter_context(socket.socket()) for _ in range(count)]
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        return [f"tcp/127.0.0.1:{one.getsockname()[1]}" for one in sockets]


def when(state: Callable[[], Any], fulfilled: Callable[[Any], bool]) -> Any:
    """The first state that fulfils a condition; fails after the deadline."""
    deadline = time.monotonic() + WAIT_S
    while not fulfilled(found := state()):
        assert time.monotonic() < deadline, f"never came true; last: {found}"
    return found


@dataclass
class Pair:
    """Two daemons, the sensors of their machine, and whoever follows what they say."""

    start_daemon: Any
    endpoints: list[str]
    extra: str
    text: str = CONFIG
    stamps: list[int] = field(default_factory=list)
    sent: list[tuple[float, float]] = field(default_factory=list)
    sent_ns: int = 0
    position_m: float = 1.0
    velocity_m_s: float = 0.0
    estimates: list[Any] = field(default_factory=list)
    daemons: dict[int, Any] = field(default_factory=dict)

    def start(self, rank: int) -> Any:
        """Start the daemon of a rank; back when it speaks, or stands by in step."""
        group = f"group = {json.dumps(self.endpoints)}\nrank = {rank}\n{self.extra}"
        self.daemons[rank] = self.start_daemon(extra=group, arguments=("configured",), text=self.text)
        when(lambda: self.member(rank), lambda found: found["in_step"])
        return self.daemons[rank]

    def member(self, rank: int) -> Any:
        """A daemon's own account of the group."""
        return ask("bench", f"member/{rank}/status", self.endpoints[rank])["group"]

    def state(self, rank: int) -> str:
        return str(self.member(rank)["state"])

    def follow(self, stack: ExitStack) -> None:
        """Sensors and consumers, each connected to both daemons."""
        sensor = SensorPublisher("bench", "ultrasonic", self.endpoints)
        self.ultrasonic = stack.enter_context(sensor)
        self.accelerometer = stack.enter_context(
            SensorPublisher("bench", "accelerometer", session=sensor.session)
        )
        self.said = stack.enter_context(EstimateSubscriber("bench", self.endpoints))
        self.commands = stack.enter_context(ControlSubscriber("bench", self.endpoints))
        self.events = stack.enter_context(TopicSubscriber("bench", "event", self.endpoints))

    def measure(self) -> tuple[float, float]:
        """Acceleration and position of a car of 1 kg that has followed the newest command for one step."""
        command, step_s = self.commands.latest(), STEP_NS / 1e9
        force = 0.0 if command is None else command["u"]["force"]
        self.position_m += self.velocity_m_s * step_s + 0.5 * force * step_s**2
        self.velocity_m_s += force * step_s
        return force, self.position_m

    def send(self, count: int = 1) -> None:
        """Send readings, each as soon as the estimate of the one before has come."""
        for _ in range(count):
            acceleration, position = self.measure()
            t_ns = self.next_stamp()
            self.sent.append((acceleration, position))
            self.stamps.append(t_ns)
            self.accelerometer.publish([acceleration], t_ns)
            self.ultrasonic.publish([position], t_ns)
            self.wait_for(t_ns)

    def next_stamp(self) -> int:
        """A step after the last; after a pause, beyond where ticks may have taken the daemons meanwhile."""
        now_ns = time.monotonic_ns()
        passed_ns, self.sent_ns = now_ns - self.sent_ns, now_ns
        if not self.stamps:
            return time.time_ns()
        return self.stamps[-1] + STEP_NS + (passed_ns + SHORT_NS if passed_ns > SHORT_NS else 0)

    def wait_for(self, t_ns: int) -> None:
        """Until an estimate of that time has come."""
        while not self.estimates or self.estimates[-1]["t_ns"] < t_ns:
            message = self.said.next(WAIT_S)
            assert message is not None, f"no estimate of reading {len(self.sent)}"
            self.estimates.append(message)

    def unanswered(self) -> set[int]:
        """Stamps of readings without an estimate; estimates on ticks, while nothing was sent, answer nothing."""
        return set(self.stamps) - {one["t_ns"] for one in self.estimates}

    def check_numbers(self) -> None:
        """Numbers grow with every estimate, epochs and stamps never shrink."""
        seqs = [one["seq"] for one in self.estimates]
        epochs = [one["epoch"] for one in self.estimates]
        assert seqs == sorted(set(seqs))
        assert epochs == sorted(epochs)

    def takeover(self) -> Any:
        """The event of the next take-over."""
        return next(message["takeover"] for message in self.events if "takeover" in message.content)


@pytest.fixture
def pair(start) -> Iterator[Callable[..., Pair]]:
    """Two daemons in step: `pair()`, `pair(extra="...")`, `pair(text="...")`."""
    with ExitStack() as stack:

        def run(extra: str = PATIENT, text: str = CONFIG) -> Pair:
            found = Pair(start, free_endpoints(2), extra, text)
            found.start(0)
            found.start(1)
            found.follow(stack)
            found.ultrasonic.wait_until_heard()
            return found

        yield run


def alone(assembly: Any, pair: Pair) -> Any:
    """Reports of one engine that takes the same readings and never dies."""
    readings = np.zeros(2 * len(pair.sent), assembly.layout.reading)
    for k, values in enumerate(pair.sent):
        for place, name in enumerate(("accelerometer", "ultrasonic")):
            one = readings[2 * k + place]
            one["sensor"], one["seq"], one["flags"] = assembly.layout.numbers[name], k, HAS_SEQ | HAS_ARRIVAL
            one["t_ns"] = one["arrival_ns"] = pair.stamps[k]
            one["length"], one["z"][0] = 1, values[place]
    reports = assembly.engine().process(readings)
    return reports[reports["sensor"] == assembly.layout.numbers["ultrasonic"]]


def test_a_killed_daemon_is_replaced_without_a_gap(pair, assembly):
    """Every reading has its estimate, numbered without a gap, equal to the bits of a daemon that was never killed."""
    # GIVEN two daemons in step; WHEN the one that speaks is killed between two readings
    both = pair()
    both.send(40)
    both.daemons[0].process.kill()
    both.send(40)

    # THEN the other goes on as if nothing had happened, but for its epoch and an event
    assert [one["t_ns"] for one in both.estimates] == both.stamps
    assert [one["seq"] for one in both.estimates] == list(range(1, len(both.sent) + 1))
    epochs = [one["epoch"] for one in both.estimates]
    assert epochs == sorted(epochs)
    assert epochs.count(epochs[0]) == 40
    assert len(set(epochs)) == 2
    expected = alone(assembly, both)
    for one, report in zip(both.estimates, expected, strict=True):
        assert list(one["state"].values()) == report["x"].tolist()
        assert list(one["std"].values()) == report["std"].tolist()
    assert {one["resets"] for one in both.estimates} == {0}
    event = both.takeover()
    assert (event["rank"], event["from_rank"], event["cause"], event["in_step"]) == (1, 0, "gone", True)
    assert (event["from_epoch"], event["epoch"]) == (epochs[0], epochs[-1])
    assert ask("bench", "status", both.endpoints[1])["epoch"] == epochs[-1]


@pytest.mark.parametrize("law", LAWS)
def test_commands_go_on_without_a_bump(pair, law):
    """Commands are numbered on, and none changes more at the take-over than at other times."""
    both = pair(text=LAWS[law])
    both.send(60)
    both.daemons[0].process.kill()
    both.send(60)
    followed = []
    while not followed or followed[-1]["t_ns"] < both.stamps[-1]:
        message = both.commands.next(WAIT_S)
        assert message is not None, "commands ended"
        followed.append(message)
    pairs = [(one["epoch"], one["seq"]) for one in followed]
    assert pairs == sorted(set(pairs))
    seqs = [one["seq"] for one in followed]
    assert seqs == sorted(set(seqs))
    change = next(k for k in range(1, len(pairs)) if pairs[k][0] != pairs[k - 1][0])
    u = np.array([one["u"]["force"] for one in followed])
    steps = np.abs(np.diff(u)) / np.diff(seqs)
    around = np.concatenate([steps[change - 11 : change - 1], steps[change : change + 10]])
    assert steps[change - 1] <= 2.0 * around.max()
    assert all(one["valid"] for one in followed)


class Wire:
    """Everything that goes out on some topics, whoever sent it, in the order it came."""

    def __init__(self, stack: ExitStack, endpoints: list[str], *topics: str) -> None:
        self.heard: list[tuple[str, Any]] = []
        self.session = stack.enter_context(join(endpoints, timeout_s=WAIT_S))
        handler = zenoh.handlers.Callback(self._take, indirect=False)
        self._kept = [self.session.declare_subscriber(f"fusiond/bench/{one}", handler) for one in topics]

    def _take(self, sample: Any) -> None:
        self.heard.append((str(sample.key_expr), json.loads(sample.payload.to_bytes())))


@pytest.fixture
def wire() -> Iterator[Callable[..., Wire]]:
    with ExitStack() as stack:
        yield lambda endpoints, *topics: Wire(stack, endpoints, *topics)


def test_a_standby_says_nothing(pair, wire):
    """Of everything on the keys of the outputs, all is of one epoch, and nothing is said twice."""
    both = pair()
    heard = wire(both.endpoints, "estimate", "control", "event", "pulse", "report/*", "local/*", "health")
    both.send(40)
    epoch = both.estimates[0]["epoch"]
    when(
        lambda: list(heard.heard),
        lambda found: {f"fusiond/bench/{one}" for one in OUT} <= {k for k, _ in found},
    )
    assert {content["epoch"] for _, content in heard.heard} == {epoch}
    stamps = [content["t_ns"] for key, content in heard.heard if key.endswith("/estimate")]
    assert stamps == sorted(set(stamps))


def test_a_hung_daemon_is_replaced_and_is_silent_when_it_wakes(pair, wire):
    both = pair(extra="")
    heard = wire(both.endpoints, "estimate", "control", "health", "event", "pulse")
    both.send(20)
    hung = both.daemons[0].process
    hung.send_signal(signal.SIGSTOP)
    both.send(20)
    hung.send_signal(signal.SIGCONT)
    both.send(20)
    found = when(lambda: both.member(0), lambda found: found["state"] == "standby" and found["in_step"])
    assert {(one["rank"], one["state"]) for one in found["members"]} == {(0, "standby"), (1, "active")}
    assert len(both.unanswered()) <= 1
    both.check_numbers()
    epochs = [content["epoch"] for key, content in heard.heard if key.endswith("/estimate")]
    assert epochs == sorted(epochs), "it spoke after it was replaced"


def test_who_returns_stands_by_and_is_ready_to_take_over_again(pair, assembly):
    """Killed, started again: no fail-back; the other killed in turn: still no gap, still the same bits."""
    both = pair()
    both.send(20)
    both.daemons[0].process.kill()
    both.send(20)
    both.start(0)
    assert both.state(0) == "standby"
    both.send(20)
    assert both.state(1) == "active"
    both.daemons[1].process.kill()
    both.send(20)
    assert not both.unanswered()
    both.check_numbers()
    assert len({one["epoch"] for one in both.estimates}) == 3
    # The first after the pause is a prediction: the accelerometer's reading of that stamp comes before the range.
    said = {one["t_ns"]: one for one in both.estimates if one["health"] != "dead_reckoning"}
    assert len(said) >= len(both.sent) - 1
    for report in alone(assembly, both):
        if (one := said.get(int(report["t_ns"]))) is not None:
            assert list(one["state"].values()) == report["x"].tolist()


def test_a_daemon_that_is_stopped_hands_over_at_once(pair):
    both = pair()
    both.send(20)
    assert both.daemons[0].terminate() == 0
    both.send(20)
    assert not both.unanswered()
    both.check_numbers()
    assert both.takeover()["cause"] == "gone"


def test_of_two_that_speak_the_one_with_the_earlier_epoch_steps_down(start, wire):
    """Two daemons that could not see each other both speak; as soon as they can, one does, in the later epoch."""
    endpoints, epochs = free_endpoints(2), []
    for rank, endpoint in enumerate(endpoints):
        extra = f'listen = ["{endpoint}"]\nrank = {rank}\n{PATIENT}'
        start(extra=extra, arguments=("configured",))
        status = when(lambda at=endpoint: asked(at, "status"), lambda found: found is not None)
        assert status["group"]["state"] == "active"
        epochs.append(status["epoch"])
    assert epochs == sorted(epochs)
    bridge = open_session(session_options("router", ["tcp/127.0.0.1:0"], endpoints))
    try:
        first = when(
            lambda: asked(endpoints[0], "member/0/status"),
            lambda found: found["group"]["in_step"] and found["group"]["state"] == "standby",
        )
        second = asked(endpoints[1], "member/1/status")
        assert (second["group"]["state"], second["epoch"]) == ("active", epochs[1])
        assert {one["state"] for one in first["group"]["members"]} == {"active", "standby"}
    finally:
        bridge.close()


def test_a_claim_that_is_weaker_moves_nobody_and_a_stronger_one_does(pair):
    both = pair()
    both.send(5)
    session = open_session(session_options("client", connect=both.endpoints[:1]))
    try:
        epoch = both.estimates[-1]["epoch"]
        weak = session.liveliness().declare_token(f"fusiond/bench/{token_of(Member(9, 'f', epoch - 1))}")
        when(lambda: both.member(0), lambda found: len(found["members"]) == 3)
        assert both.state(0) == "active"
        strong = session.liveliness().declare_token(f"fusiond/bench/{token_of(Member(9, 'e', epoch + 1))}")
        when(lambda: both.state(0), lambda state: state == "standby")
        strong.undeclare()
        weak.undeclare()
        when(lambda: [both.state(0), both.state(1)], lambda states: sorted(states) == ["active", "standby"])
    finally:
        session.close()


def test_a_reset_of_the_active_reaches_the_standby(pair):
    both = pair()
    both.send(20)
    ask("bench", "command/reset", both.endpoints[1])
    both.send(5)

    def resets() -> int:
        both.send(1)
        return int(ask("bench", "member/1/status", both.endpoints[1])["resets"])

    when(resets, lambda found: found == 1)
    both.daemons[0].process.kill()
    both.send(5)
    assert {one["resets"] for one in both.estimates[-5:]} == {1}


def test_another_configuration_is_no_twin(start, pair):
    """It does not go on from the other's bytes, and what leads from one estimate to the other is told as of a reset."""
    endpoints = free_endpoints(2)
    both = Pair(start, endpoints, PATIENT)
    both.start(0)
    noisy = CONFIG.replace("noise_std = { position_m = 0.01 }", "noise_std = { position_m = 0.05 }")
    extra = f"group = {json.dumps(endpoints)}\nrank = 1\n{PATIENT}"
    both.daemons[1] = start(extra=extra, arguments=("configured",), text=noisy)
    when(lambda: both.member(1), lambda found: len(found["members"]) == 2)
    with ExitStack() as stack:
        both.follow(stack)
        both.ultrasonic.wait_until_heard()
        both.send(20)
        assert not both.member(1)["in_step"]
        both.daemons[0].process.kill()
        both.send(2)
        before, after = both.estimates[19], both.estimates[20]
        assert after["epoch"] > before["epoch"]
        assert after["resets"] == 1
        event = next(message for message in both.events if "takeover" in message.content)
        assert event["takeover"]["in_step"] is False
        assert event["reset"] == {"resets": 1, "jump": after["jump"]}
        assert any(size != 0.0 for size in after["jump"].values())


def test_a_rank_beyond_the_group_is_the_operators_mistake(config):
    text = config.read_text(encoding="utf-8") + 'group = ["tcp/127.0.0.1:0"]\n'
    config.write_text(text, encoding="utf-8")
    assembly = load(config)
    with pytest.raises(
        ConfigError, match=r"service\.rank: is 1 \(limit 0, the last of service\.group\); count"
    ):
        settings_of(assembly.config, assembly.layout, (), (), 1)


def test_of_every_two_daemons_of_a_group_one_connects_to_the_other(config):
    """Were both to connect, a link made anew after one has hung could carry messages under wrong keys."""
    endpoints = [f"tcp/127.0.0.1:{7447 + k}" for k in range(3)]
    text = config.read_text(encoding="utf-8") + f"group = {json.dumps(endpoints)}\n"
    config.write_text(text, encoding="utf-8")
    assembly = load(config)
    found = [settings_of(assembly.config, assembly.layout, (), (), rank) for rank in range(3)]
    assert [one.listen for one in found] == [(one,) for one in endpoints]
    dialled = [{endpoints[rank], other} for rank, one in enumerate(found) for other in one.connect]
    assert sorted(map(sorted, dialled)) == [endpoints[:2], endpoints[::2], endpoints[1:]]


NONSENSE = [
    b"[]",
    b"{",
    b"7",
    b'{"t_ns": 1, "seq": 1, "epoch": %d}',
    b'{"t_ns": 1, "seq": 1, "epoch": %d, "u": "x"}',
    b'{"t_ns": 1, "seq": 1, "epoch": 1000000000000000000000000000000}',
]
"""Of which a daemon must take none for a message; with the latest epoch there is."""


def test_what_is_no_message_on_the_keys_of_the_outputs_ends_nobody(pair):
    """A standby reads what the active one says: whatever else comes there, it goes on, and takes over."""
    both = pair()
    both.send(20)
    stranger = both.ultrasonic.session
    for topic in OUT:
        for payload in NONSENSE:
            text = payload.replace(b"%d", str(2**62).encode())
            stranger.put(f"fusiond/bench/{topic}", text, encoding="application/json")
    stranger.put("fusiond/bench/pulse", '{"id": "f", "seq": {"estimate": "x"}}')
    both.send(20)
    assert both.member(1)["in_step"]
    both.daemons[0].process.kill()
    both.send(20)
    assert not both.unanswered()
    assert both.takeover()["in_step"] is True


def test_of_readings_in_flight_at_a_kill_the_newest_has_its_estimate(pair, wire):
    """Between the kill and the take-over the newest reading alone is answered, after it every one; nothing twice."""
    both = pair()
    both.send(20)
    heard = wire(both.endpoints, "estimate")
    in_flight = []
    for k in range(30):
        if k == 10:
            both.daemons[0].process.kill()
        in_flight.append(both.stamps[-1] + STEP_NS * (k + 1))
        both.accelerometer.publish([0.0], in_flight[-1])
        both.ultrasonic.publish([both.position_m], in_flight[-1])
    both.wait_for(in_flight[-1])
    last = when(lambda: both.state(1), lambda state: state == "active")
    both.stamps.append(in_flight[-1])
    both.send(20)
    assert last == "active"
    assert not both.unanswered()
    both.check_numbers()
    numbers = [(one["epoch"], one["seq"]) for _, one in heard.heard]
    assert len(numbers) == len(set(numbers))


def asked(endpoint: str, what: str) -> Any:
    """A daemon's answer, None where nobody answers yet."""
    try:
        return ask("bench", what, endpoint)
    except ConnectionFailed:
        return None
