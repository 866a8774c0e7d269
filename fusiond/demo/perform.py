"""A demonstration from beginning to end: start both processes, watch them, stop them, judge."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import signal
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import orjson
from rich.console import Console

from fusiond.assembly.assembly import Assembly, load
from fusiond.demo.displays import Display, Silence, display_for
from fusiond.demo.found import found_checks
from fusiond.demo.plants import PLANTS, config_of, lying_rig
from fusiond.demo.processes import Process, ProcessFailed, wait_until
from fusiond.demo.scene import Scene, Setting
from fusiond.demo.unsteered import UNSTEERED, Unsteered, run_of
from fusiond.demo.verdict import (
    Check,
    Verdict,
    consistency_check,
    end_check,
    goal_check,
    loss_check,
    replay_check,
    without_promise,
    without_trailing_ticks,
)
from fusiond.errors import ConfigError, FusiondError
from fusiond.recording.log import open_log
from fusiond.recording.replay import replay
from fusiond.recording.summary import Summary
from fusiond.recording.truth import read_truth
from fusiond.service.ask import Refused
from fusiond.service.client import EstimateSubscriber, TopicSubscriber, ask
from fusiond.simulation.faults import Fault, parse_faults
from fusiond.simulation.rig import STEP_NS
from fusiond.types import NANOSECONDS, nanoseconds

READY_S = 180.0
"""Longest start of the daemon: on a slow machine with a cold cache it compiles for tens of seconds."""
FRAME_S = 0.1
STATUS_S = 0.5
SHORTEST_S, LONGEST_S = 1.0, 3600.0
ANY_PORT = "tcp/127.0.0.1:0"
INTERRUPTED = 130
"""Exit status after Ctrl-C or SIGTERM, as shells use it."""


class Interrupted(Exception):
    """Raised in the main thread by SIGTERM or SIGHUP, so that every way out ends the processes."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a demonstration came to."""

    summary: Summary
    verdict: Verdict
    end: dict[str, Any]
    pids: Mapping[str, int]
    injected: tuple[str, ...] = ()

    def json_object(self) -> dict[str, Any]:
        """The object of `replay --json`, with the verdict and the plant's own account."""
        plant = {name: value for name, value in self.end.items() if name != "end"}
        others: dict[str, Any] = {
            "plant": plant,
            "pids": dict(self.pids),
            "verdict": self.verdict.json_object(),
        }
        if self.injected:
            others["injected"] = list(self.injected)
        return self.summary.json_object() | others


def demonstrate(name: str, duration_s: float, *, json_output: bool, seed: int, inject: Sequence[str]) -> int:
    """`fusiond demo`; returns the exit status. Raises: ConfigError."""
    display: Display = Silence() if json_output else display_for(Console())
    try:
        outcome = perform(name, duration_s, seed, display, inject)
    except ConfigError:
        raise
    except (KeyboardInterrupt, Interrupted):
        print("demo: interrupted; both processes ended, no verdict", file=sys.stderr)
        return INTERRUPTED
    except FusiondError as error:
        print(error, file=sys.stderr)
        return 1
    if json_output:
        print(orjson.dumps(outcome.json_object()).decode())
    display.judge(outcome.verdict)
    return 0 if outcome.verdict.ok else 1


def perform(name: str, duration_s: float, seed: int, display: Display, inject: Sequence[str] = ()) -> Outcome:
    """Run it. Raises: ConfigError; FusiondError where a process fails; Interrupted, KeyboardInterrupt."""
    if not SHORTEST_S <= duration_s <= LONGEST_S:
        raise ConfigError(
            f"demo.for: {duration_s:g} s (limits {SHORTEST_S:g} to {LONGEST_S:g} s); choose another --for"
        )
    faults = parse_faults(inject)
    _require_name(name, seed, duration_s, inject)
    config = config_of(name)
    assembly = load(config)
    if name in PLANTS and _goal_m(assembly) is None:
        raise ConfigError(
            f"{config}: has no [control] with a reference for position_m; the demonstration needs a goal"
        )
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="fusiond-demo-")))
        stack.enter_context(_signals_raise())
        stack.callback(display.close)
        stage = Stage(assembly, name, duration_s, seed, folder, display, stack, faults)
        display.say("demo: starting the daemon (the first time it compiles for some seconds)")
        stage.start(config)
        stage.watch()
        display.close()
        return stage.outcome()


def _require_name(name: str, seed: int, duration_s: float, inject: Sequence[str]) -> None:
    """Raise ConfigError where nothing of that name can be shown, or its sensors cannot lie as they are asked to."""
    if name in PLANTS:
        lying_rig(name, seed, inject)
    elif name in UNSTEERED:
        run_of(name, seed, min(duration_s, 1.0), inject)
    else:
        known = ", ".join(sorted({*PLANTS, *UNSTEERED}))
        raise ConfigError(f"demo {name}: no plant of that name; choose one of {known}")


def _goal_m(assembly: Assembly) -> float | None:
    """Where the configured control steers the position; None where it does not."""
    control = assembly.config.control
    return None if control is None else control.reference.get("position_m")


class Stage:
    """Both processes and who watches them."""

    def __init__(
        self, assembly: Assembly, name: str, duration_s: float, seed: int, folder: Path, display: Display,
        stack: contextlib.ExitStack, faults: Sequence[Fault] = (),
    ) -> None:  # fmt: skip
        self._assembly, self._name, self._duration_s, self._seed = assembly, name, duration_s, seed
        self._recording, self._truth = folder / "run.mcap", folder / "truth.csv"
        self._display, self._stack, self._faults = display, stack, tuple(faults)
        self._namespace = assembly.config.prefix

    def start(self, config: Path) -> None:
        """The daemon, then the plant. Raises: ProcessFailed, ConnectionFailed."""
        run = [
            "-m",
            "fusiond.cli",
            "run",
            str(config),
            "--listen",
            ANY_PORT,
            "--record",
            str(self._recording),
        ]
        self._daemon = self._process("daemon", run, orphan_safe=True)
        endpoint = self._endpoint()
        options = ["--seed", str(self._seed), "--for", repr(self._duration_s), "--connect", endpoint]
        files = ["--namespace", self._namespace, "--truth", str(self._truth)]
        lies = [word for fault in self._faults for word in ("--inject", str(fault))]
        estimates = EstimateSubscriber(self._name, endpoint, namespace=self._namespace)
        self._estimates = self._stack.enter_context(estimates)
        self._control = self._stack.enter_context(
            TopicSubscriber(self._name, "control", namespace=self._namespace, session=estimates.session)
        )
        self._plant = self._process(
            "plant", ["-m", "fusiond.demo.plant", self._name, *options, *files, *lies]
        )
        self._scene = Scene(
            Setting(
                name=self._name, duration_s=self._duration_s, goal_m=_goal_m(self._assembly),
                units={slot.name: slot.unit for slot in self._assembly.layout.states}, endpoint=endpoint,
                pids={"daemon": self._daemon.pid, "plant": self._plant.pid}, faults=self._faults,
                watched=UNSTEERED.get(self._name, Unsteered(("position",), own_noise=True)).watched,
            )
        )  # fmt: skip

        pids = self._scene.setting.pids
        self._display.say(
            f"demo: daemon {pids['daemon']} at {endpoint}, plant {pids['plant']}, Zenoh between them"
        )

    def watch(self) -> None:
        """Show what happens until the plant has ended. Raises: ProcessFailed, ConnectionFailed."""
        self._began_s = asked_s = time.monotonic()
        give_up_s = self._began_s + 3.0 * self._duration_s + 30.0
        while self._plant.running():
            self._daemon.check()
            if time.monotonic() > give_up_s:
                raise self._plant.failed(
                    "is far behind its own time; this machine is too slow or too busy for it"
                )
            if time.monotonic() - asked_s >= STATUS_S:
                asked_s = time.monotonic()
                with contextlib.suppress(Refused):  # busy: it says so by being late
                    self._scene.status = self._status()
            self._look()
            time.sleep(FRAME_S)
        self._wall_s = time.monotonic() - self._began_s
        self._plant.check()
        if not wait_until(self._look_for_end, 2.0):
            raise self._plant.failed("ended without its last line")
        assert self._scene.end is not None
        if self._scene.end["t_ns"] < nanoseconds(self._duration_s) // STEP_NS * STEP_NS:
            raise self._plant.failed(f"was stopped at {self._scene.end['t_ns'] / NANOSECONDS:.3f} s")
        during = self._scene.status
        self._counted = self._status() if during is None else dict(during)
        wait_until(self._all_arrived, 3.0)
        # Rates and health as they were while there was a plant.
        self._scene.show_counts_of(self._counted, during)
        self._look()

    def outcome(self) -> Outcome:
        """Stop the daemon, replay what it recorded against the plant's truth, judge. Raises: FusiondError."""
        end, layout = self._scene.end, self._assembly.layout
        assert end is not None
        self._estimates.close()
        if self._daemon.end():
            raise self._daemon.failed("did not end as it should")
        angles = self._assembly.resolved.process.angles
        truth = read_truth(self._truth, angles)
        log = open_log(self._recording, layout)
        events = [0]
        summary = replay(
            self._assembly.engine(), without_trailing_ticks(log), truth=truth, refusals=log.refusals,
            progress=events.append,
        )  # fmt: skip
        dofs = {sensor.name: len(sensor.channels) for sensor in layout.sensors}
        unsteered, goal_m = UNSTEERED.get(self._name), self._scene.setting.goal_m
        healthy = (
            end_check(summary, truth) if goal_m is None else goal_check(truth, goal_m, self._seed),
            consistency_check(summary, dofs, own_noise=unsteered is None or unsteered.own_noise),
        )
        checks = (
            *(without_promise(check) if self._faults else check for check in healthy),
            loss_check(end, self._counted, lied=bool(self._faults)),
            replay_check(self._recording, events[-1], summary),
            *self._found(summary, end["t_ns"] / NANOSECONDS),
        )
        return Outcome(
            dataclasses.replace(summary, wall_s=self._wall_s),
            Verdict(checks),
            dict(end),
            self._scene.setting.pids,
            tuple(str(fault) for fault in self._faults),
        )

    def _found(self, summary: Summary, end_s: float) -> tuple[Check, ...]:
        """What was found of what was injected, where anything was."""
        if not self._faults:
            return ()
        detects = self._assembly.config.faults is not None
        return found_checks(self._faults, summary, end_s, detects=detects)

    def _process(self, name: str, arguments: Sequence[str], *, orphan_safe: bool = False) -> Process:
        process = Process(name, [sys.executable, *arguments], orphan_safe=orphan_safe)
        self._stack.enter_context(process)
        return process

    def _endpoint(self) -> str:
        """What the daemon's `ready` line says. Raises: ProcessFailed."""
        deadline_s = time.monotonic() + READY_S
        while True:
            words = self._daemon.line(max(0.1, deadline_s - time.monotonic())).split()
            if words and words[0] == "ready":
                found = [word for word in words[1:] if word.startswith("tcp/127.0.0.1:")]
                if not found:
                    raise self._daemon.failed(f"says `{' '.join(words)}`, which has no endpoint on loopback")
                return found[0]

    def _look(self) -> None:
        while (message := self._estimates.next(0.0)) is not None:
            self._scene.estimated(message.content)
        for line in self._plant.lines():
            self._scene.told(json.loads(line))
        control = self._control.latest()
        self._scene.control = None if control is None else control.content
        self._display.show(self._scene)

    def _look_for_end(self) -> bool:
        self._look()
        return self._scene.end is not None

    def _all_arrived(self) -> bool:
        """Whether the daemon has taken as many readings as were sent."""
        assert self._scene.end is not None
        with contextlib.suppress(Refused):
            self._counted = self._status()
        return bool(self._counted["readings"] >= sum(self._scene.end["sent"].values()))

    def _status(self) -> dict[str, Any]:
        try:
            answer: dict[str, Any] = ask(
                self._name, "status", namespace=self._namespace, session=self._estimates.session
            )
        except Refused:
            raise
        except FusiondError as error:
            self._daemon.check()
            raise ProcessFailed(f"demo: the daemon does not answer ({error})") from error
        return answer


@contextlib.contextmanager
def _signals_raise() -> Iterator[None]:
    """SIGTERM and SIGHUP (the terminal was closed) as an exception while this lasts."""

    def interrupt(number: int, frame: FrameType | None) -> None:
        raise Interrupted

    before = {number: signal.signal(number, interrupt) for number in (signal.SIGTERM, signal.SIGHUP)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
