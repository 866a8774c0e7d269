"""Let a real sensor lie: a relay in front of its key, its faults switched on and off while it runs.

    python -m tools.inject relay --from raw/ultrasonic --to fusiond/minicar/sensor/ultrasonic
    python -m tools.inject relay --from raw/ultrasonic --config configs/minicar.toml --sensor ultrasonic
    python -m tools.inject set ultrasonic.bias=0.5                # from the next reading on
    python -m tools.inject set ultrasonic.bias=0.5@now+5          # for five seconds
    python -m tools.inject set ultrasonic.stuck@60+5              # a minute after the relay began
    python -m tools.inject list
    python -m tools.inject clear ultrasonic.bias                  # or clear: everything

The sensor publishes on a key of its own, the relay where the daemon listens; the daemon cannot tell. A relay that
knows the configuration (or --noise-std) can multiply the sensor's noise and wrap its angles. A relay prints
`ready FROM -> TO` when it listens and runs until SIGTERM. Exit 0 done, 1 nobody answered, 2 the operator's mistake.
"""

from __future__ import annotations

import argparse
import json
import math
import signal
import sys
import threading
import time
from collections.abc import Sequence
from typing import Any

import zenoh

from fusiond.errors import ConfigError, ConnectionFailed, FusiondError
from fusiond.service.endpoints import checked_key
from fusiond.service.sessions import DEFAULT_ENDPOINT, open_session, session_options
from fusiond.simulation.faults import near
from fusiond.simulation.faults_injection import Measured
from fusiond.types import Slot
from tools.inject_relay import CONTROL, Relay, answer_of

CONNECT_S = 10.0
TRIES, PAUSE_S, ANSWER_S = 4, 0.1, 2.0
WAITING = 65536
"""Puts that may wait for the relay before it makes the network wait."""


def parser() -> argparse.ArgumentParser:
    """The command line."""
    tool = argparse.ArgumentParser(
        prog="python -m tools.inject",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = tool.add_subparsers(dest="command", required=True, metavar="COMMAND")
    relay = commands.add_parser("relay", help="stand in front of a sensor until SIGTERM")
    relay.add_argument(
        "--from", dest="source", required=True, metavar="KEY", help="where the sensor publishes"
    )
    relay.add_argument(
        "--to", metavar="KEY", help="where the daemon listens; --config and --sensor know it too"
    )
    relay.add_argument("--sensor", metavar="NAME", help="its name in a SPEC; default the last chunk of --to")
    relay.add_argument("--config", metavar="CONFIG", help="says its noise, its channels and which are angles")
    relay.add_argument("--noise-std", metavar="A,B,...", help="its noise, where there is no --config")
    relay.add_argument(
        "--inject", action="append", default=[], metavar="SPEC", help="a fault from the beginning"
    )
    relay.add_argument("--seed", type=int, default=0, help="of everything random")
    for name, words in (
        ("set", "switch faults on, now or at START after the relay began"),
        ("clear", "switch faults off: these, or all"),
        ("list", "the faults that are set, and what was passed on"),
    ):
        command = commands.add_parser(name, help=words)
        if name != "list":
            command.add_argument("specs", metavar="SPEC", nargs="+" if name == "set" else "*")
        command.add_argument("--to", metavar="KEY", help="only the relay that publishes there")
        command.add_argument("--json", action="store_true", help="print one JSON object and nothing else")
    for command in commands.choices.values():
        command.add_argument("--connect", default=DEFAULT_ENDPOINT, metavar="EP", help="daemon or router")
    return tool


def main(argv: Sequence[str] | None = None) -> int:
    """Run the tool; returns the exit status."""
    given = parser().parse_args(argv)
    try:
        return stand(given) if given.command == "relay" else tell(given)
    except ConfigError as mistake:
        print(mistake, file=sys.stderr)
        return 2
    except FusiondError as failure:
        print(failure, file=sys.stderr)
        return 1


def stand(given: argparse.Namespace) -> int:
    """`relay`: until SIGTERM or Ctrl-C. Raises: ConfigError, ConnectionFailed."""
    sensor, slots, to = front_of(given)
    source = checked_key(given.source, "--from")
    if zenoh.KeyExpr(source).intersects(zenoh.KeyExpr(to)):
        raise ConfigError(
            f"--from {source}: the relay would hear itself on {to}; let the sensor publish elsewhere"
        )
    if given.seed < 0:
        raise ConfigError(f"--seed {given.seed}: is below 0; give a whole number from 0 up")
    relay = Relay(sensor, given.seed, time.monotonic_ns, slots, lambda text: print(text, file=sys.stderr))
    for specification in given.inject:
        relay.set(specification)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, _interrupt)
    with open_session(session_options("client", connect=[given.connect]), timeout_s=CONNECT_S) as session:
        puts: Any = session.declare_subscriber(source, zenoh.handlers.FifoChannel(WAITING))
        questions = session.declare_queryable(f"{CONTROL}/{to}", zenoh.handlers.FifoChannel(64))
        threading.Thread(target=_answer, args=(questions, relay, to), daemon=True).start()
        print(f"ready {source} -> {to}", flush=True)
        try:
            while True:
                _pass_on(session, to, relay, puts.recv())
        except KeyboardInterrupt:
            pass
    print(f"inject: {sensor.name}: {_counts(relay.counts)}", file=sys.stderr)
    return 0


def front_of(given: argparse.Namespace) -> tuple[Measured, tuple[Slot, ...], str]:
    """The sensor a relay stands for, its channels where they are known, and its key. Raises: ConfigError."""
    if given.config is None:
        if given.to is None:
            raise ConfigError(
                "--to: is missing; name the key the daemon listens on, or --config and --sensor"
            )
        name = given.sensor or given.to.rpartition("/")[2]
        sigma = None if given.noise_std is None else _deviations(given.noise_std)
        return Measured(name, sigma=sigma), (), checked_key(given.to, "--to", single=True)
    if given.noise_std is not None:
        raise ConfigError("--noise-std: the configuration says it already; leave one of them out")
    from pathlib import Path

    from fusiond.assembly.assembly import load
    from fusiond.demo.injecting import measured_of

    assembly = load(Path(given.config))
    keys = {one.name: assembly.config.key_of(one.name) for one in assembly.layout.sensors}
    name = given.sensor or next((name for name, key in keys.items() if key == given.to), None)
    if name not in keys:
        wanted = given.sensor or given.to or ""
        raise ConfigError(f"--sensor {wanted}: {given.config} has no such sensor; {near(wanted, keys)}")
    layout = assembly.layout.sensor(name)
    assert layout is not None
    return (
        measured_of(assembly)[layout.number],
        layout.channels,
        checked_key(given.to or keys[name], "--to", single=True),
    )


def tell(given: argparse.Namespace) -> int:
    """`set`, `clear`, `list`: the running relays do it. Raises: ConfigError, ConnectionFailed."""
    key = f"{CONTROL}/{checked_key(given.to, '--to') if given.to else '**'}"
    specs: list[str] = getattr(given, "specs", []) or [""]
    answers: list[dict[str, Any]] = []
    with open_session(session_options("client", connect=[given.connect]), timeout_s=CONNECT_S) as session:
        relays = _ask(session, key, {"command": "list"})
        if not relays:
            raise ConnectionFailed(
                f"inject {given.command}: no relay answers at {given.connect}; start one with `relay`, or name its "
                "endpoint with --connect"
            )
        for spec in specs:
            named = spec.partition("@")[0].partition(".")[0]
            meant = [one for one in relays if not named or one["sensor"] == named]
            if not meant:
                known = {str(one["sensor"]) for one in relays}
                raise ConfigError(f"inject {spec}: no relay in front of `{named}`; {near(named, known)}")
            for one in meant:
                question = {"command": given.command, "spec": spec}
                answers += _ask(session, f"{CONTROL}/{one['to']}", question)
    for answer in answers:
        if "mistake" in answer:
            raise ConfigError(answer["mistake"])
    _show(given, answers)
    return 0


def _show(given: argparse.Namespace, answers: list[dict[str, Any]]) -> None:
    if given.json:
        print(json.dumps({"relays": answers}))
        return
    for answer in answers:
        done = (
            f"{given.command} {', '.join(answer['done']) or 'nothing'}; " if given.command != "list" else ""
        )
        faults = f"set: {', '.join(answer['faults'])}" if answer["faults"] else "no fault set"
        print(
            f"{answer['sensor']} at {answer['elapsed_s']:.1f} s: {done}{faults} ({_counts(answer['counts'])})"
        )


def _ask(session: zenoh.Session, key: str, question: dict[str, str]) -> list[dict[str, Any]]:
    """Every relay's answer; asked again where there is none, which Zenoh says at once right after connecting."""
    for attempt in range(TRIES):
        if attempt:
            time.sleep(PAUSE_S)
        replies = session.get(
            key, payload=json.dumps(question), encoding="application/json", timeout=ANSWER_S,
            target=zenoh.QueryTarget.ALL, consolidation=zenoh.ConsolidationMode.NONE,
        )  # fmt: skip
        found = [json.loads(reply.ok.payload.to_bytes()) for reply in replies if reply.ok is not None]
        if found:
            return found
    return []


def _answer(questions: Any, relay: Relay, to: str) -> None:
    """Answer what is asked until the session closes."""
    try:
        for query in questions:
            with query:
                payload = b"" if query.payload is None else query.payload.to_bytes()
                query.reply(f"{CONTROL}/{to}", answer_of(relay, to, payload), encoding="application/json")
    except zenoh.ZError:
        return


def _pass_on(session: zenoh.Session, to: str, relay: Relay, sample: zenoh.Sample) -> None:
    """Send what became of one put, with everything else as it came."""
    quality: dict[str, Any] = {
        "attachment": sample.attachment, "timestamp": sample.timestamp, "priority": sample.priority,
        "congestion_control": sample.congestion_control, "express": sample.express,
    }  # fmt: skip
    if sample.kind == zenoh.SampleKind.DELETE:
        session.delete(to, **quality)
        return
    payload = relay.pass_on(str(sample.encoding), sample.payload.to_bytes())
    if payload is not None:
        session.put(to, payload, encoding=sample.encoding, **quality)


def _deviations(text: str) -> tuple[float, ...]:
    try:
        found = tuple(float(word) for word in text.split(","))
    except ValueError:
        found = ()
    if not found or not all(math.isfinite(one) and one >= 0.0 for one in found):
        raise ConfigError(f"--noise-std {text}: no deviations; write one number per channel, 0.1,0.1")
    return found


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{number} {what}" for what, number in counts.items())


def _interrupt(number: int, frame: object) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
