"""Two daemons as processes and a car at rest that both of them hear: what `bench_failover` measures with."""

from __future__ import annotations

import json
import os
import random
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import zenoh

from fusiond.errors import FusiondError
from fusiond.service.ask import ask
from fusiond.service.publisher import SensorPublisher
from fusiond.service.sessions import join
from tools.bench_service import CONFIG, NAME

RATE_HZ = 200.0
PERIOD_NS = round(1e9 / RATE_HZ)
STRETCH_S = 0.75
"""How long is looked at before a daemon is lost, and after another speaks."""
PATIENCE_S = 60.0
POLL_S = 0.05


@dataclass(frozen=True, slots=True)
class Heard:
    """One estimate as it came: when (ns, monotonic), of which stamp, under which number and epoch."""

    came_ns: int
    t_ns: int
    seq: int
    epoch: int


class Car:
    """A car at rest: its sensors as a thread, and every estimate that comes back, whoever sent it.

    Args:
        endpoints: of all daemons, each of which hears it directly.
    `sent`: when (ns, monotonic) and with which stamp.
    """

    def __init__(self, endpoints: Sequence[str]) -> None:
        self.sent: list[tuple[int, int]] = []
        self.heard: list[Heard] = []
        self._daemons = len(endpoints)
        self._session = join(endpoints)
        self._came = threading.Condition()
        handler = zenoh.handlers.Callback(self._take, indirect=False)
        self._follower = self._session.declare_subscriber(f"fusiond/{NAME}/estimate", handler)
        self._sensors = [
            SensorPublisher(NAME, name, encoding="record", session=self._session)
            for name in ("accelerometer", "ultrasonic")
        ]
        self._driving = True
        self._thread = threading.Thread(target=self._drive, daemon=True)

    def __enter__(self) -> Self:
        for sensor in self._sensors:
            sensor.wait_until_heard()
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._driving = False
        self._thread.join()
        time.sleep(STRETCH_S)  # for what is on its way
        self._session.close()

    def hears_all(self) -> bool:
        """Whether it is connected to every daemon."""
        return len(self._session.info.peers_zid()) >= self._daemons

    def wait_for_epoch_after(self, epoch: int) -> int:
        """When the first estimate of a later epoch came, ns of the monotonic clock."""
        with self._came:
            if not self._came.wait_for(lambda: self.heard[-1].epoch > epoch, PATIENCE_S):
                raise RuntimeError("nobody took over")
            return next(one.came_ns for one in self.heard if one.epoch > epoch)

    def _take(self, sample: zenoh.Sample) -> None:
        came_ns = time.monotonic_ns()
        content = json.loads(sample.payload.to_bytes())
        with self._came:
            self.heard.append(Heard(came_ns, content["t_ns"], content["seq"], content["epoch"]))
            self._came.notify_all()

    def _drive(self) -> None:
        """Noise as it is declared, at a paced rate: nothing here is a fault."""
        noise, began_ns, k = random.Random(0), time.monotonic_ns(), 0
        while self._driving:
            while (left_ns := began_ns + k * PERIOD_NS - time.monotonic_ns()) > 0:
                time.sleep(left_ns / 1e9)
            stamp = time.time_ns()
            for sensor in self._sensors:
                sensor.publish(noise.gauss(0.0, 0.01), stamp)
            self.sent.append((time.monotonic_ns(), stamp))
            k += 1


class Group:
    """Two daemons of one configuration as processes, each ended by its pid."""

    def __init__(self, folder: Path) -> None:
        with ExitStack() as stack:
            sockets = [stack.enter_context(socket.create_server(("127.0.0.1", 0))) for _ in range(2)]
            self.endpoints = [f"tcp/127.0.0.1:{one.getsockname()[1]}" for one in sockets]
        every = re.compile(r"^rate_hz = [\d.]+", re.MULTILINE)
        text = every.sub(f"rate_hz = {RATE_HZ}", CONFIG.read_text(encoding="utf-8"))
        service = f"\n[service]\npublish_hz = 1e5\ngroup = {json.dumps(self.endpoints)}\n"
        self._config = folder / CONFIG.name
        self._config.write_text(text + service, encoding="utf-8")
        self._processes: dict[int, subprocess.Popen[str]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for process in self._processes.values():
            end(process)

    def address(self, rank: int) -> tuple[str, int]:
        """Host and port of a daemon."""
        host, _, port = self.endpoints[rank].removeprefix("tcp/").partition(":")
        return host, int(port)

    def start(self, rank: int) -> None:
        """Start the daemon of a rank; back when it speaks, or stands by in step."""
        command = [str(Path(sys.executable).with_name("fusiond")), "run", str(self._config)]
        self._processes[rank] = subprocess.Popen(
            [*command, "--rank", str(rank)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        until(lambda: self._account(rank).get("in_step"))

    def active(self) -> int:
        """Rank of the daemon that speaks."""
        return next(rank for rank in self._processes if self._account(rank).get("state") == "active")

    def lose(self, rank: int, how: signal.Signals) -> None:
        """Kill or stop a daemon."""
        os.kill(self._processes[rank].pid, how)

    def have_back(self, rank: int, how: signal.Signals) -> None:
        """Start it again, or let it go on; back when it stands by in step."""
        if how is signal.SIGKILL:
            end(self._processes[rank])
            self.start(rank)
        else:
            self.lose(rank, signal.SIGCONT)
        until(lambda: self._stands_by(self._account(rank)))

    @staticmethod
    def _stands_by(found: dict[str, Any]) -> bool:
        return found.get("state") == "standby" and found["in_step"]

    def _account(self, rank: int) -> dict[str, Any]:
        """What a daemon says of the group; nothing where it does not answer."""
        with suppress(FusiondError):
            return dict(ask(NAME, f"member/{rank}/status", self.endpoints[rank])["group"])
        return {}


def end(process: subprocess.Popen[str]) -> None:
    """End a process by its pid, whatever state it is in."""
    if process.poll() is None:
        process.kill()
    process.wait()
    assert process.stdout is not None
    process.stdout.close()


def until(fulfilled: Callable[[], Any]) -> None:
    """Wait until something is so. Raises: RuntimeError where it never comes true."""
    deadline = time.monotonic() + PATIENCE_S
    while not fulfilled():
        if time.monotonic() > deadline:
            raise RuntimeError(f"not as it should be within {PATIENCE_S:g} s")
        time.sleep(POLL_S)
