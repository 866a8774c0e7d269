"""A daemon as a process of its own, on a port of its own, ended by its pid."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from fusiond.assembly.assembly import Assembly, load
from fusiond.service.client import ask

PROJECT = Path(__file__).resolve().parents[2]
DEADLINE_S = 20.0
CONFIG = """
name = "bench"
[model]
kind = "driven_point_mass"
bias = true
velocity_noise_m_s_sqrt_s = 1e-3
[initial]
state = { position_m = 0.0, velocity_m_s = 0.0, acceleration_bias_m_s2 = 0.0 }
std = { position_m = 1.0, velocity_m_s = 1.0, acceleration_bias_m_s2 = 0.1 }
[sensor.accelerometer]
kind = "input"
drives = ["acceleration"]
noise_std = { acceleration_m_s2 = 0.01 }
[sensor.ultrasonic]
kind = "direct"
slots = ["position"]
rate_hz = 50.0
max_silence_s = 0.5
noise_std = { position_m = 0.01 }
valid = { position_m = [-100.0, 100.0] }
[control]
law = "pd"
rate_hz = 50.0
proportional_gain_n_m = 1.0
derivative_gain_n_s_m = 1.0
limit_n = 1.0
reference = { position_m = 2.0 }
[history]
horizon_s = 2.0
[service]
publish_hz = 10000.0
"""
RUN = """
import sys
from pathlib import Path
from fusiond.assembly.assembly import load
from fusiond.service.serve import serve
from fusiond.service.telemetry import set_up
set_up(as_json=True)
config, record, *rest = sys.argv[1:]
listen = [one for one in rest if one.startswith("tcp/")]
connect = [one.removeprefix("connect=") for one in rest if one.startswith("connect=")]
sys.exit(serve(load(Path(config)), listen=listen, connect=connect, record=Path(record) if record else None,
               on_ready=lambda endpoints: print("ready", *endpoints, flush=True)))
"""


@dataclass
class Running:
    """One daemon's process."""

    process: subprocess.Popen[str]
    endpoint: str
    config: Path

    def status(self) -> Any:
        return ask("bench", "status", self.endpoint)

    def status_when(self, fulfilled: Callable[[Any], bool]) -> Any:
        """The first status that fulfils a condition; fails after the deadline."""
        deadline = time.monotonic() + DEADLINE_S
        while not fulfilled(status := self.status()):
            assert time.monotonic() < deadline, f"never came true; last: {status}"
        return status

    def terminate(self) -> int:
        """SIGTERM; the exit status."""
        self.process.terminate()
        return self.process.wait(DEADLINE_S)


Start = Callable[..., Running]


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "bench.toml"
    path.write_text(CONFIG, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def assembly(tmp_path_factory: pytest.TempPathFactory) -> Assembly:
    path = tmp_path_factory.mktemp("assembly") / "bench.toml"
    path.write_text(CONFIG, encoding="utf-8")
    return load(path)


@pytest.fixture
def start(config: Path) -> Iterator[Start]:
    """Start daemons: `start()`, `start(record=PATH)`, `start(extra="...")`, `start(arguments=[...])`, `start(text="")`.

    Without arguments they listen on a free port; `configured` leaves it to the configuration.
    """
    with ExitStack() as stack:

        def run(
            record: Path | None = None, extra: str = "", arguments: tuple[str, ...] = (), text: str = CONFIG
        ) -> Running:
            config.write_text(text + extra, encoding="utf-8")
            chosen = arguments or ("tcp/127.0.0.1:0",)
            command = [sys.executable, "-c", RUN, str(config), str(record or ""), *chosen]
            process = stack.enter_context(
                subprocess.Popen(
                    command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=PROJECT
                )
            )
            stack.callback(end, process)
            assert process.stdout is not None
            words = process.stdout.readline().split()
            assert words[:1] == ["ready"], process.stderr.read() if process.stderr else ""
            return Running(process, words[1], config)

        yield run


def end(process: subprocess.Popen[str]) -> None:
    """End a process by its pid, whatever state it is in."""
    if process.poll() is None:
        process.kill()
        process.wait(DEADLINE_S)
