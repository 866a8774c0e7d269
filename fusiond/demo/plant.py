"""The plant's own process: it moves in real time, publishes what its sensors measure, does what `control` says.

    python -m fusiond.demo.plant minicar --seed 0 --for 30 --connect tcp/127.0.0.1:7447 --truth truth.csv

One reading a put: the accelerometer at 1 kHz, the ultrasonic sensor every 30 ms. Each command is answered on `applied`.
A system that nobody steers (`unsteered`) sends what was simulated before, at its own stamps.
With --inject its sensors lie: what is sent, and so what the loop feels, is what the faults make of the readings.
Truth goes to stdout, a JSON line every 30 ms, and whole into a file at the end: never over Zenoh, where the daemon is.
"""

from __future__ import annotations

import argparse
import json
import signal
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fusiond.demo.plants import TRUTH, lying_rig, truth_of
from fusiond.demo.unsteered import UNSTEERED, Playing, run_of
from fusiond.errors import FusiondError
from fusiond.service.client import ControlSubscriber, SensorPublisher
from fusiond.simulation.logs import write_truth
from fusiond.simulation.rig import STEP_NS, PointRig
from fusiond.simulation.tables import Reading, Truth
from fusiond.types import NANOSECONDS, nanoseconds

SENSORS = ("accelerometer", "ultrasonic", "applied")
TELL_NS = 30_000_000
"""How often truth is told: with every reading that updates the state."""
MOST_BEHIND_NS = 1_000_000_000
"""Longest delay that is caught up in a burst, as the world would have gone on; of a longer one (a stopped process) the
rest is a pause of the plant. A pause is worse: meanwhile the daemon's ticks run ahead of the plant's time, and it has
given the commands of that time already."""

Publish = Callable[[tuple[float, ...], int], None]


@dataclass(slots=True)
class LivePlant:
    """One plant in real time. Its time is exact whatever the pacing: step k ends at k milliseconds.

    Args:
        publish: by sensor.      command: newest command as its message, None before the first.
        tell: gets a line of JSON for whoever watches.      now_ns, sleep: the clock that paces it.
    """

    rig: PointRig
    publish: Mapping[str, Publish]
    command: Callable[[], Mapping[str, Any] | None]
    tell: Callable[[dict[str, Any]], None]
    now_ns: Callable[[], int] = time.monotonic_ns
    sleep: Callable[[float], None] = time.sleep
    stopping: bool = False
    sent: dict[str, int] = field(default_factory=lambda: dict.fromkeys(SENSORS, 0))
    truth: list[tuple[float, float, float]] = field(default_factory=list)
    worst_behind_ns: int = 0
    paused_ns: int = 0
    _force_n: float = field(init=False)
    _followed: tuple[int, int] = (0, 0)

    def __post_init__(self) -> None:
        # Until a command comes the plant stands still: at the bi-rotor somebody holds it.
        self._force_n = self.rig.plant.weight_n

    def run(self, steps: int) -> None:
        """Go so many milliseconds, or until stopped."""
        self._note(self.rig.begin())
        begin_ns = self.now_ns()
        for step in range(1, steps + 1):
            if self.stopping:
                return
            begin_ns = self._wait(begin_ns, begin_ns + step * STEP_NS)
            self._obey()
            self._note(self.rig.advance(self._force_n))

    def summary(self) -> dict[str, Any]:
        """The last line told."""
        return {
            "end": True, "t_ns": self.rig.t_ns, "sent": self.sent,
            "worst_behind_s": self.worst_behind_ns / NANOSECONDS, "paused_s": self.paused_ns / NANOSECONDS,
        }  # fmt: skip

    def _wait(self, begin_ns: int, due_ns: int) -> int:
        """Sleep until due; returns the beginning, moved on by what is too late to catch up."""
        behind_ns = self.now_ns() - due_ns
        if behind_ns < 0:
            self.sleep(-behind_ns / NANOSECONDS)
            return begin_ns
        self.worst_behind_ns = max(self.worst_behind_ns, behind_ns)
        pause_ns = max(0, behind_ns - MOST_BEHIND_NS)
        self.paused_ns += pause_ns
        return begin_ns + pause_ns

    def _obey(self) -> None:
        """Take over a new command and say so; one that is not valid means standing still."""
        command = self.command()
        if command is None or (command["epoch"], command["seq"]) == self._followed:
            return
        self._followed = (command["epoch"], command["seq"])
        self._force_n = float(command["u"]["force"]) if command["valid"] else self.rig.plant.weight_n
        self._send(self.rig.tell([Reading(self.rig.t_ns, "applied", (self._force_n,))]))

    def _note(self, readings: list[Reading]) -> None:
        self._send(readings)
        truth = truth_of(self.rig)
        self.truth.append(truth)
        if self.rig.t_ns % TELL_NS == 0:
            self.tell({"t_ns": self.rig.t_ns, **dict(zip(TRUTH, truth, strict=True))})

    def _send(self, readings: list[Reading]) -> None:
        for reading in readings:
            self.publish[reading.sensor](reading.z, reading.t_ns)
            self.sent[reading.sensor] += 1


def live(
    name: str,
    seed: int,
    duration_s: float,
    connect: str,
    namespace: str,
    truth_file: Path,
    inject: Sequence[str],
) -> None:
    """Connect, wait until the daemon listens, run, and write the truth. Raises: ConfigError, ConnectionFailed."""
    rig = lying_rig(name, seed, inject)
    with ControlSubscriber(name, connect, namespace=namespace) as control:
        publishers = {
            sensor: SensorPublisher(
                name, sensor, connect, namespace=namespace, encoding="record", session=control.session
            )
            for sensor in SENSORS
        }
        for publisher in publishers.values():
            publisher.wait_until_heard()
        plant = LivePlant(rig, {s: p.publish for s, p in publishers.items()}, lambda: _newest(control), _tell)
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: _stop(plant))
        plant.run(nanoseconds(duration_s) // STEP_NS)
        for publisher in publishers.values():
            publisher.close()
    t_ns = np.arange(len(plant.truth), dtype=np.int64) * STEP_NS
    write_truth(truth_file, Truth(t_ns, TRUTH, np.array(plant.truth)))
    _tell(plant.summary())


def play(
    name: str,
    seed: int,
    duration_s: float,
    connect: str,
    namespace: str,
    truth_file: Path,
    inject: Sequence[str],
) -> None:
    """The same for a system that nobody steers. Raises: ConfigError, ConnectionFailed."""
    run = run_of(name, seed, duration_s, inject)
    session, publishers = None, {}
    for sensor in sorted({reading.sensor for reading in run.readings}):
        publishers[sensor] = SensorPublisher(
            name, sensor, connect, namespace=namespace, encoding="record", session=session
        )
        session = publishers[sensor].session
    for publisher in publishers.values():
        publisher.wait_until_heard()
    playing = Playing(run, nanoseconds(duration_s), {s: p.publish for s, p in publishers.items()}, _tell)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: _stop(playing))
    playing.play()
    for publisher in reversed(publishers.values()):
        # the first one opened the session
        publisher.close()
    write_truth(truth_file, run.truth)
    _tell(playing.summary())


def _newest(control: ControlSubscriber) -> Mapping[str, Any] | None:
    message = control.latest()
    return None if message is None else message.content


def _stop(plant: LivePlant | Playing) -> None:
    plant.stopping = True


def _tell(line: dict[str, Any]) -> None:
    print(json.dumps(line), flush=True)


def main() -> int:
    """The command line of the process."""
    command = argparse.ArgumentParser(
        prog="python -m fusiond.demo.plant", description="A simulated plant, live."
    )
    command.add_argument("name")
    command.add_argument("--seed", type=int, default=0)
    command.add_argument("--for", dest="duration_s", type=float, default=30.0)
    command.add_argument("--connect", required=True)
    command.add_argument("--namespace", default=None)
    command.add_argument("--truth", type=Path, required=True)
    command.add_argument("--inject", action="append", default=[])
    given = command.parse_args()
    try:
        namespace = given.namespace or f"fusiond/{given.name}"
        go = play if given.name in UNSTEERED else live
        go(given.name, given.seed, given.duration_s, given.connect, namespace, given.truth, given.inject)
    except BrokenPipeError:
        # Whoever watched has gone, and with it the reason to go on; Python would complain once more at its exit.
        sys.stdout = None
        return 1
    except FusiondError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
