"""The recordings live: a player process, the real daemon, Zenoh between them, and the state of the replay."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from fusiond.assembly.assembly import load
from fusiond.service.client import ask
from tools.pages.recorded import CONFIGS, Recorded

pytestmark = pytest.mark.recordings("jackal", "dresden_car", "udacity_laser_radar")
DEADLINE_S = 60.0
PLAYER = """
import sys
from pathlib import Path
from fusiond.assembly.assembly import load
from fusiond.recording.log import open_log
from fusiond.service.client import Player
config, log, endpoint = sys.argv[1:]
layout = load(Path(config)).layout
with Player(layout.name, layout, endpoint, speed=float("inf"), most_hz=4000.0) as player:
    player.wait_until_heard()
    for chunk in open_log(Path(log), layout):
        player.play(chunk)
    print("played", flush=True)
    sys.stdin.read()
"""
"""Stays until its standard input ends: a session that closes at once may take with it what still waits to be sent."""
LATER = "\n[history]\nhorizon_s = 30.0\n"
"""Played forty times as fast as recorded, what the network delays by a moment is late by seconds."""


@pytest.fixture
def start() -> Iterator[Callable[..., subprocess.Popen[str]]]:
    """Start processes that are ended by their own pid, whatever happens."""
    with ExitStack() as stack:

        def run(*command: str) -> subprocess.Popen[str]:
            arguments = [sys.executable, *command]
            process = stack.enter_context(
                subprocess.Popen(arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
            )
            stack.callback(process.wait, DEADLINE_S)
            stack.callback(process.kill)
            return process

        yield run


@pytest.mark.parametrize(
    "name", ["jackal", "dresden_car", "udacity_laser_radar", "udacity_laser_radar_robot"]
)
def test_played_live_a_recording_ends_in_the_bits_of_its_replay(name, log_of, start, tmp_path):
    """Every reading arrives, and the track record ends byte for byte as in the replay."""
    config = tmp_path / f"{name}.toml"
    config.write_text((CONFIGS / f"{name}.toml").read_text(encoding="utf-8") + LATER, encoding="utf-8")
    log = log_of(name.removesuffix("_robot"))
    replayed = Recorded(load(config), log).run()

    daemon = start("-m", "fusiond.cli", "run", str(config), "--listen", "tcp/127.0.0.1:0")
    word, endpoint = daemon.stdout.readline().split()
    assert word == "ready"
    player = start("-c", PLAYER, str(config), str(log), endpoint)
    assert player.stdout.readline() == "played\n"
    live = settled(name, endpoint, replayed.readings)
    player.stdin.close()
    assert player.wait(DEADLINE_S) == 0
    assert live["readings"] == replayed.readings
    assert {one: of["used"] for one, of in live["sensors"].items()} == {
        one: of.used for one, of in replayed.sensors.items()
    }
    assert live["resets"] == replayed.resets == 0
    assert live["state_sha256"] == replayed.state_sha256
    daemon.terminate()
    assert daemon.wait(DEADLINE_S) == 0


def settled(name: str, endpoint: str, readings: int):
    """The daemon's status once it has taken so many readings, or at the deadline."""
    deadline = time.monotonic() + DEADLINE_S
    while True:
        status = ask(name, "status", endpoint)
        if status["readings"] >= readings or time.monotonic() > deadline:
            return status
