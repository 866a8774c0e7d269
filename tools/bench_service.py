"""Measures the daemon over Zenoh on loopback: highest paced rate without a loss, and round trip.

Every figure stands beside its yardstick from the same run: a subscriber of the same kind (ring and thread of its own)
that only counts, and a bare echo. Each end is a process of its own. Run `python -m tools.bench_service`.
"""

from __future__ import annotations

import argparse
import json
import random
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import zenoh

from fusiond.service.ask import ask
from fusiond.service.publisher import SensorPublisher
from fusiond.service.reading_record import ENCODING, HEADER, MAGIC, encode_record
from fusiond.service.sessions import open_session, open_sessions, session_options

NAME, SENSOR = "minicar", "ultrasonic"
CONFIG = Path(__file__).resolve().parents[1] / "configs" / f"{NAME}.toml"
KEY = f"fusiond/{NAME}/sensor/{SENSOR}"
RING = 8192
BURST_S = 0.001
"""Paced traffic goes out in bursts of this length: a process cannot sleep much shorter."""


def run_counter() -> None:
    """A subscriber of the daemon's kind that only counts: answers `status` with what it received."""
    sessions = open_sessions("peer", ["tcp/127.0.0.1:0"], [])
    ring = sessions.sensors.declare_subscriber(KEY, zenoh.handlers.RingChannel(RING))
    seen = {"used": 0}

    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(f"fusiond/{NAME}/status", json.dumps({"sensors": {SENSOR: seen}}))

    sessions.admin.declare_queryable(
        f"fusiond/{NAME}/status", zenoh.handlers.Callback(answer, indirect=False)
    )
    print("ready", *sessions.endpoints, flush=True)
    _in_thread(lambda: _count(ring, seen))
    sys.stdin.read()
    sessions.close()


def _count(ring: Any, seen: dict[str, int]) -> None:
    while True:
        ring.recv().payload.to_bytes()
        seen["used"] += 1


def run_echo(topic: str) -> None:
    """Sends every sensor's payload back at once on a topic, from a ring and a thread of its own."""
    sessions = open_sessions("peer", ["tcp/127.0.0.1:0"], [])
    ring = sessions.sensors.declare_subscriber(f"fusiond/{NAME}/sensor/*", zenoh.handlers.RingChannel(RING))
    publisher = sessions.sensors.declare_publisher(f"fusiond/{NAME}/{topic}")

    def echo() -> None:
        while True:
            publisher.put(ring.recv().payload)

    print("ready", *sessions.endpoints, flush=True)
    _in_thread(echo)
    sys.stdin.read()
    sessions.close()


def _in_thread(work: Callable[[], None]) -> None:
    def until_closed() -> None:
        try:
            work()
        except zenoh.ZError:
            return

    threading.Thread(target=until_closed, daemon=True).start()


def run_daemon(publish_hz: float, record: str, command_hz: float) -> None:
    """The daemon with the mini car's configuration, until SIGTERM; with command_hz the one under LQG, commanding so."""
    from fusiond.assembly.assembly import assemble
    from fusiond.config import read
    from fusiond.service.serve import serve

    # without [faults]: paced readings of one sensor are no car's, and would be judged all the time
    config = read(CONFIG).model_copy(update={"faults": None})
    if command_hz:
        steered = read(CONFIG.with_name(f"{NAME}_lqg.toml"))
        assert steered.control is not None
        control = steered.control.model_copy(update={"rate_hz": command_hz})
        config = steered.model_copy(update={"control": control, "namespace": f"fusiond/{NAME}"})
    service = config.service.model_copy(update={"publish_hz": publish_hz})
    assembly = assemble(config.model_copy(update={"service": service}), CONFIG.parent)
    sys.exit(
        serve(
            assembly, listen=["tcp/127.0.0.1:0"], record=Path(record) if record else None,
            on_ready=lambda endpoints: print("ready", *endpoints, flush=True),
        )
    )  # fmt: skip


@contextmanager
def process(role: str, *arguments: str) -> Iterator[str]:
    """One of the above as a process; gives its endpoint and ends it by its pid."""
    command = [sys.executable, "-m", "tools.bench_service", "--role", role, *arguments]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, stderr=subprocess.DEVNULL) as child:
        assert child.stdout is not None
        try:
            words = child.stdout.readline().split()
            if words[:1] != ["ready"]:
                raise RuntimeError(f"{role}: did not become ready")
            yield words[1]
        finally:
            child.terminate()
            child.wait(10)


def received(endpoint: str, session: zenoh.Session) -> int:
    """Readings the other end has taken."""
    return int(ask(NAME, "status", endpoint, session=session)["sensors"][SENSOR]["used"])


def send_paced(publisher: Any, first: int, rate_hz: float, for_s: float) -> tuple[int, float]:
    """Put records of one number at a paced rate, one a put; returns how many, and the rate that was reached."""
    count = int(rate_hz * for_s)
    began_ns, wall_ns = time.monotonic_ns(), time.time_ns()
    sent = 0
    while sent < count:
        due = min(count, int((time.monotonic_ns() - began_ns) * rate_hz / 1e9) + 1)
        while sent < due:
            t_ns = wall_ns + int(sent * 1e9 / rate_hz)
            publisher.put(encode_record((0.5,), t_ns, first + sent))
            sent += 1
        time.sleep(BURST_S)
    return sent, sent * 1e9 / (time.monotonic_ns() - began_ns)


@dataclass(frozen=True, slots=True)
class Trial:
    """One trial at a paced rate: what was sent and taken, and the rate the sender reached."""

    sent: int
    taken: int
    reached_hz: float

    def passed(self, wanted_hz: float) -> bool:
        """Nothing is missing, and the rate was really reached."""
        return self.sent == self.taken and self.reached_hz > 0.95 * wanted_hz


class RateSearch:
    """Finds the highest paced rate without a missing reading at one endpoint."""

    def __init__(self, endpoint: str) -> None:
        self._endpoint = endpoint
        self._session = open_session(session_options("client", connect=[endpoint]))
        self.estimates = 0
        handler = zenoh.handlers.Callback(self._note, indirect=False)
        self._follower = self._session.declare_subscriber(f"fusiond/{NAME}/estimate", handler)
        SensorPublisher(NAME, SENSOR, encoding="record", session=self._session).wait_until_heard()
        self._publisher = self._session.declare_publisher(KEY, encoding=ENCODING)
        self._first = 0

    def _note(self, _: zenoh.Sample) -> None:
        self.estimates += 1

    def trial(self, rate_hz: float, for_s: float) -> Trial:
        """Send at a rate; wait until what is on its way has come, or no more comes."""
        before = received(self._endpoint, self._session)
        sent, reached_hz = send_paced(self._publisher, self._first, rate_hz, for_s)
        self._first += sent
        taken, last, quiet_since = 0, -1, time.monotonic()
        while taken < sent and time.monotonic() - quiet_since < 1.0:
            taken = received(self._endpoint, self._session) - before
            if taken != last:
                last, quiet_since = taken, time.monotonic()
        return Trial(sent, taken, reached_hz)

    def highest(self, start_hz: float = 4000.0, for_s: float = 2.0, steps: int = 4) -> float:
        """Doubled until a trial fails, then bisected so many times. A failed trial may be repeated once."""
        good, bad = 0.0, 0.0
        rate = start_hz
        while not bad or steps > 0:
            trials = (self.trial(rate, for_s) for _ in range(2))
            if any(trial.passed(rate) for trial in trials):
                good = rate
            else:
                bad = rate
            steps -= bool(bad)
            rate = (good + bad) / 2 if bad else 2 * rate
        return good

    def close(self) -> None:
        """Leave."""
        self._session.close()


def highest_rate(endpoint: str) -> dict[str, float]:
    """`rate_hz` found at an endpoint, and `estimates` received meanwhile."""
    search = RateSearch(endpoint)
    try:
        return {"rate_hz": search.highest(), "estimates": float(search.estimates)}
    finally:
        search.close()


class Arrivals:
    """What comes back on a topic, and when: from a ring and a thread of its own, as at the bare echo."""

    def __init__(self, session: zenoh.Session, topic: str) -> None:
        self.came: list[tuple[int, zenoh.Sample]] = []
        self._ring = session.declare_subscriber(f"fusiond/{NAME}/{topic}", zenoh.handlers.RingChannel(1024))
        _in_thread(self._collect)

    def _collect(self) -> None:
        while True:
            sample = self._ring.recv()
            self.came.append((time.perf_counter_ns(), sample))

    def ages_s(self, sent: dict[int, int]) -> list[float]:
        """Times from each put (ns, by the stamp of its reading) to what came back for it, s, sorted.

        An estimate on a tick, before the first reading, answers nothing that was sent.
        """
        stamped = ((came, stamp_of(sample)) for came, sample in self.came)
        return sorted((came - sent[stamp]) / 1e9 for came, stamp in stamped if stamp in sent)


def round_trips(endpoint: str, *, rate_hz: float = 1000.0, for_s: float = 2.0) -> list[float]:
    """Times from a put to the estimate that comes back for it, s, at a paced rate, sorted."""
    session = open_session(session_options("client", connect=[endpoint]))
    back = Arrivals(session, "estimate")
    sensor = SensorPublisher(NAME, SENSOR, encoding="record", session=session)
    sensor.wait_until_heard()
    publisher = session.declare_publisher(KEY, encoding=ENCODING)
    # As its sensor scatters: a value that never changes would be found frozen, and judged.
    values = random.Random(0).choices([0.49, 0.495, 0.5, 0.505, 0.51], k=int(rate_hz * for_s))
    sent: dict[int, int] = {}
    began_ns = time.perf_counter_ns()
    for k in range(int(rate_hz * for_s)):
        while (left_ns := began_ns + int(k * 1e9 / rate_hz) - time.perf_counter_ns()) > 0:
            time.sleep(left_ns / 1e9)
        stamp = time.time_ns()
        record = encode_record((values[k],), stamp, k)
        sent[stamp] = time.perf_counter_ns()
        publisher.put(record)
    deadline = time.monotonic() + 2.0
    while len(back.came) < len(sent) and time.monotonic() < deadline:
        time.sleep(0.05)
    times = back.ages_s(sent)
    session.close()
    if len(times) < 0.99 * len(sent):
        raise RuntimeError(f"{endpoint}: {len(sent)} sent, only {len(times)} came back")
    return times


def centile(times: list[float], percent: int) -> float:
    """Of sorted times."""
    return times[len(times) * percent // 100]


def stamp_of(sample: zenoh.Sample) -> int:
    """The stamp of the reading that a message goes back to."""
    payload = sample.payload.to_bytes()
    if payload.startswith(MAGIC):
        return int(HEADER.unpack_from(payload)[5])
    return int(json.loads(payload)["t_ns"])


def bench_throughput() -> dict[str, Any]:
    """Rates of the counting subscriber and of the daemon, recording off and on, and their ratios."""
    with process("counter") as endpoint:
        counter = highest_rate(endpoint)["rate_hz"]
    with process("daemon") as endpoint:
        plain = highest_rate(endpoint)
    with (
        tempfile.TemporaryDirectory() as folder,
        process("daemon", "--record", f"{folder}/run.mcap") as endpoint,
    ):
        recording = highest_rate(endpoint)
    return {
        "counter_hz": counter, "daemon_hz": plain["rate_hz"], "recording_hz": recording["rate_hz"],
        "estimates": plain["estimates"],
        "ratio": plain["rate_hz"] / counter, "ratio_recording": recording["rate_hz"] / counter,
    }  # fmt: skip


def bench_round_trip(repeats: int = 5) -> dict[str, Any]:
    """Round trips of the daemon and of a bare echo, in turn; medians over the repeats, us."""
    found: dict[str, list[float]] = {"echo_p50": [], "echo_p99": [], "daemon_p50": [], "daemon_p99": []}
    with process("echo") as echo, process("daemon", "--publish-hz", "1e9") as daemon:
        for _ in range(repeats):
            for name, endpoint in (("echo", echo), ("daemon", daemon)):
                times = round_trips(endpoint)
                for percent in (50, 99):
                    found[f"{name}_p{percent}"].append(centile(times, percent) * 1e6)
    result: dict[str, Any] = {
        f"{name}_us": sorted(values)[len(values) // 2] for name, values in found.items()
    }
    return result | {
        "ratio_p50": result["daemon_p50_us"] / result["echo_p50_us"],
        "ratio_p99": result["daemon_p99_us"] / result["echo_p99_us"],
    }


def main() -> None:
    """Print both as one JSON object, or play one of the roles."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--role", choices=["counter", "echo", "daemon"])
    parser.add_argument("--publish-hz", type=float, default=50.0)
    parser.add_argument("--record", default="")
    parser.add_argument("--topic", default="estimate")
    parser.add_argument("--command-hz", type=float, default=0.0)
    chosen = parser.parse_args()
    match chosen.role:
        case "counter":
            run_counter()
        case "echo":
            run_echo(chosen.topic)
        case "daemon":
            run_daemon(chosen.publish_hz, chosen.record, chosen.command_hz)
        case _:
            print(json.dumps({"round_trip": bench_round_trip(), "throughput": bench_throughput()}))


if __name__ == "__main__":
    main()
