"""The demonstration with its real processes over real Zenoh: runs of a second or two, every process ended by its id."""

from __future__ import annotations

import json
import os
import re
import select
import signal
import subprocess
import sys
from collections.abc import Iterator

import pytest

PATIENCE_S = 240.0
"""Of which a cold cache may take minutes to compile on a slow machine; no test waits for it to pass."""
STARTED = re.compile(r"daemon (\d+) at tcp/127\.0\.0\.1:\d+, plant (\d+)")
CONTRACT = {
    "readings", "wall_s", "final", "rmse", "nees_mean", "model", "sensors", "repairs", "output_sha256", "state_sha256",
}  # fmt: skip


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "fusiond.cli", "demo", *arguments]


def ended(pid: int, timeout_s: float) -> bool:
    """Whether a process that is no child of ours ends in time."""
    try:
        watched = os.pidfd_open(pid)
    except ProcessLookupError:
        return True
    try:
        return bool(select.select([watched], [], [], timeout_s)[0])
    finally:
        os.close(watched)


@pytest.fixture
def started() -> Iterator[tuple[subprocess.Popen[str], list[int]]]:
    """A demonstration that has just begun, and the ids of its two processes."""
    demo = subprocess.Popen(
        command("--for", "60"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert demo.stdout is not None
    pids: list[int] = []
    for line in demo.stdout:
        if found := STARTED.search(line):
            pids = [int(pid) for pid in found.groups()]
        # A line of the plant's time: the loop is closed.
        if " s | " in line:
            break
    try:
        assert len(pids) == 2
        yield demo, pids
    finally:
        for pid in (demo.pid, *pids):
            if not ended(pid, 0.0):
                os.kill(pid, signal.SIGKILL)
        demo.communicate(timeout=PATIENCE_S)


@pytest.mark.parametrize("name", ["minicar", "birotor"])
def test_the_loop_closes_and_the_outcome_is_one_json_object(name):
    """Two seconds: every reading used, the estimate consistent, the recording repeatable to the bit, nobody left."""
    # WHEN a demonstration runs with --json
    done = subprocess.run(
        command(name, "--for", "2", "--json"), capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )

    # THEN stdout is the object of the contract, and the verdict holds
    assert done.returncode == 0, done.stderr
    outcome = json.loads(done.stdout)
    assert set(outcome) >= CONTRACT
    assert outcome["verdict"]["ok"]
    assert {c["name"]: c["ok"] for c in outcome["verdict"]["checks"]} == {
        "goal": None, "consistent": True, "no loss": True, "repeatable": True,
    }  # fmt: skip
    sensors = outcome["sensors"]
    assert sensors["accelerometer"]["used"] == 2000
    assert sensors["ultrasonic"]["used"] == 67
    assert sensors["applied"]["used"] == outcome["plant"]["sent"]["applied"] > 50
    assert outcome["final"]["health"] == "nominal"
    assert {sensor["health"] for sensor in sensors.values()} == {"healthy"}
    # AND the plant moved towards the goal under the daemon's command: from 0 to 2 m, from 2 to 0.75 m
    moved_m = outcome["final"]["state"]["position"] - {"minicar": 0.0, "birotor": 2.0}[name]
    assert 0.9 < moved_m * {"minicar": 1.0, "birotor": -1.0}[name] < 2.0
    # AND both processes are gone
    assert all(ended(pid, 0.0) for pid in outcome["pids"].values())


def test_a_system_nobody_steers_is_shown_too():
    """The square robot for two seconds at rest: every reading used, an honest end, repeatable to the bit."""
    done = subprocess.run(
        command("square_robot", "--for", "2", "--json"), capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    outcome = json.loads(done.stdout)
    assert {c["name"]: c["ok"] for c in outcome["verdict"]["checks"]} == {
        "end": True, "consistent": True, "no loss": True, "repeatable": True,
    }  # fmt: skip
    assert outcome["sensors"]["encoders"]["used"] == outcome["sensors"]["accelerometer"]["used"] == 201
    assert all(ended(pid, 0.0) for pid in outcome["pids"].values())


def test_without_a_terminal_it_prints_plain_lines():
    """No escape sequence in a file; a line a second; the verdict at the end."""
    done = subprocess.run(
        command("--for", "1"), capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "\x1b" not in done.stdout
    lines = done.stdout.splitlines()
    assert any(
        re.match(r"\s*\d+\.\d\d s \| nominal \| \+- 3 sigma \| position \S+ \+-", line) for line in lines
    )
    assert lines[-1] == "verdict: everything holds"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_interrupted_it_ends_both_processes(started, number):
    """Ctrl-C, SIGTERM or a closed terminal: no process is left, and the status says so."""
    demo, pids = started
    os.kill(demo.pid, number)
    _, errors = demo.communicate(timeout=30.0)
    assert demo.returncode == 130
    assert "interrupted" in errors
    assert all(ended(pid, 0.0) for pid in pids)


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel's parent-death signal is Linux's")
def test_killed_it_leaves_no_process_behind(started):
    """Even SIGKILL, which nobody can catch, leaves neither daemon nor plant."""
    demo, pids = started
    os.kill(demo.pid, signal.SIGKILL)
    assert all(ended(pid, 20.0) for pid in pids)


@pytest.mark.parametrize("part", ["daemon", "plant"])
def test_a_process_that_dies_ends_the_demonstration_with_its_name(started, part):
    """Status 1, the part that failed on stderr, and the other one ended too."""
    demo, pids = started
    os.kill(pids[0 if part == "daemon" else 1], signal.SIGKILL)
    _, errors = demo.communicate(timeout=30.0)
    assert demo.returncode == 1
    assert f"the {part} ended with status -9" in errors
    assert all(ended(pid, 0.0) for pid in pids)


def test_a_name_nobody_knows_is_the_operators_mistake():
    done = subprocess.run(command("mincar"), capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert done.returncode == 2
    assert done.stderr.strip() == (
        "demo mincar: no plant of that name; choose one of birotor, birotor_lqg, ground_vehicle, minicar, minicar_lqg, "
        "reference_plant, square_robot, square_robot_gyro, wall_robot"
    )
