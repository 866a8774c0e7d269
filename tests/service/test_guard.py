"""The guard of the covariance in a running daemon: what it did stands in `status`."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from fusiond.service.ask import Refused
from fusiond.service.client import SensorPublisher, ask
from fusiond.simulation.registry import simulate
from fusiond.types import NANOSECONDS
from tests.service.conftest import end

PROJECT = Path(__file__).resolve().parents[2]
DEADLINE_S = 60.0
LOOKS = 41
DEVIATION = 1e-15**0.5
"""Of both sensors, which read the same output: all but perfect, so that rounding breaks what is not sound by itself."""
B = (-0.3832, 0.5919, 0.5191)
"""Column of the plant's input; the seed starts at B Q B', of rank one."""
SETTINGS = {
    "ud": 'recursion = "ud"',
    "conventional": 'recursion = "conventional"\nguard = "seed"',
    "information": 'recursion = "information"\nguard = "seed"',
    "seed": 'recursion = "seed"',
}


def config_of(recursion: str) -> str:
    """configs/reference_plant.toml at the seed's singular start, its sensors nearly perfect."""
    text = (PROJECT / "configs" / "reference_plant.toml").read_text(encoding="utf-8")
    text = text[
        : text.index("[faults]")
    ]  # a plain step has an overseer for it, which is not what this is about
    rows = [[2.3 * a * b for b in B] for a in B]
    begin, stop = text.index("std = { x1"), text.index("[sensor.applied]")
    text = f"{text[:begin]}covariance = {rows}\n{text[stop:]}"
    text = text.replace("noise_std = { y = 1.0 }", f"noise_std = {{ y = {DEVIATION!r} }}")
    text = text.replace("horizon_s = 3.0", "horizon_s = 1000.0\nmax_ahead_s = 1000.0")
    alone = "leave_one_out = false\nlocal_filters = false"
    return f"{text}\n[filter]\n{SETTINGS[recursion]}\n{alone}\n"


@contextmanager
def running(config: Path) -> Iterator[str]:
    """`fusiond run` as a process; yields its endpoint."""
    command = [sys.executable, "-m", "fusiond.cli", "run", str(config), "--listen", "tcp/127.0.0.1:0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            words = process.stdout.readline().split()
            assert words[:1] == ["ready"], process.stderr.read() if process.stderr else ""
            yield words[1]
        finally:
            end(process)


def status_after_the_run(endpoint: str) -> Any:
    """The daemon's status after LOOKS looks at the plant by both sensors."""
    readings = simulate("reference_plant", 0, LOOKS - 1.0, Q=2.3, R=(1e-15, 1e-15)).readings
    names = {reading.sensor for reading in readings}
    publishers = {name: SensorPublisher("reference_plant", name, endpoint) for name in sorted(names)}
    try:
        for publisher in publishers.values():
            publisher.wait_until_heard()
        for reading in readings:
            publishers[reading.sensor].publish(list(reading.z), t_ns=reading.t_ns + NANOSECONDS)
        return status_when(endpoint, len(readings))
    finally:
        for publisher in publishers.values():
            publisher.close()


def status_when(endpoint: str, readings: int) -> Any:
    """The first status that counts so many readings. The three keys race, so that a look is late more often than not,
    and a plain step that rolls back takes its time: a busy loop is asked again."""
    deadline = time.monotonic() + DEADLINE_S
    while time.monotonic() < deadline:
        with suppress(Refused):
            if (status := ask("reference_plant", "status", endpoint))["readings"] >= readings:
                return status
    raise AssertionError(f"not all of {readings} readings within {DEADLINE_S} s")


@pytest.mark.parametrize("recursion", ["conventional", "information", "seed"])
def test_what_the_seeds_recursions_need_repaired_is_counted_in_status(tmp_path, recursion):
    """Every repair counted, the largest and the last change published, none left unsound."""
    config = tmp_path / "plant.toml"
    config.write_text(config_of(recursion), encoding="utf-8")
    with running(config) as endpoint:
        status = status_after_the_run(endpoint)
    assert status["sensors"]["y1"]["used"] == status["sensors"]["y2"]["used"] == LOOKS
    guard = status["guard"]
    assert status["repairs"] == guard["repairs"] >= 1
    assert guard["unsound"] == 0
    assert 0.0 < guard["last"] <= guard["largest"] <= 1.0 + 1e-6
    assert guard["condition"] > 1.0


def test_ud_needs_no_repair(tmp_path):
    config = tmp_path / "plant.toml"
    config.write_text(config_of("ud"), encoding="utf-8")
    with running(config) as endpoint:
        status = status_after_the_run(endpoint)
    assert status["sensors"]["y1"]["used"] == status["sensors"]["y2"]["used"] == LOOKS
    assert status["repairs"] == 0
    assert status["guard"] == {}
