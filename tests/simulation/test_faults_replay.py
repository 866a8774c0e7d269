"""`fusiond replay --inject`: the engine on a log that lies, repeatable to the bit."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from fusiond.assembly.assembly import Assembly, load
from fusiond.cli.replaying import replay_log
from fusiond.recording.mcap_log import McapLog
from fusiond.simulation.logs import write_log
from fusiond.simulation.registry import simulate

PROJECT = Path(__file__).resolve().parents[2]
CONFIG = PROJECT / "configs" / "minicar.toml"


@pytest.fixture(scope="module")
def assembly() -> Assembly:
    return load(CONFIG)


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("log") / "log.csv"
    write_log(path, simulate("minicar", duration_s=3.0))
    return path


@pytest.fixture
def run(assembly: Assembly, log: Path):
    def replayed(*inject: str, source: Path = log, out: Path | None = None, seed: int = 0) -> dict[str, Any]:
        text = CONFIG.read_text(encoding="utf-8")
        return replay_log(assembly, source, truth=None, out=out, config_text=text, inject=inject, seed=seed)

    return replayed


def test_nothing_injected_changes_no_bit_of_the_run(run):
    honest = run()
    nothing = run("ultrasonic.bias=0@1", "accelerometer.scale=1@0")
    assert (nothing["output_sha256"], nothing["state_sha256"]) == (
        honest["output_sha256"],
        honest["state_sha256"],
    )
    assert "injected" not in honest
    assert nothing["injected"] == {"faults": ["ultrasonic.bias=0@1", "accelerometer.scale=1@0"], "seed": 0}


def test_the_same_seed_gives_the_same_run_and_another_does_not(run):
    noise = "accelerometer.noise=4@1"
    assert run(noise, seed=1)["output_sha256"] == run(noise, seed=1)["output_sha256"]
    assert run(noise, seed=1)["output_sha256"] != run(noise, seed=2)["output_sha256"]


def test_a_broken_sensor_is_a_log_without_its_readings(run, log, tmp_path):
    """From 1 s on no ultrasonic reading: the same bits as a log in which they never were."""
    without = tmp_path / "without.csv"
    head, *rows = log.read_text(encoding="ascii").splitlines()
    kept = [row for row in rows if ",ultrasonic," not in row or float(row.split(",")[0]) < 1.0]
    without.write_text("\n".join([head, *kept]) + "\n", encoding="ascii")
    broken = run("ultrasonic.broken@1")
    assert broken["sensors"]["ultrasonic"]["used"] == 34
    assert broken["output_sha256"] == run(source=without)["output_sha256"]


def test_a_recording_of_lies_replays_to_the_same_bits_and_says_what_it_holds(run, assembly, tmp_path):
    out = tmp_path / "run.mcap"
    lying = run("ultrasonic.bias=0.5@1+1", "accelerometer.nan@2+0.01", out=out, seed=3)
    assert lying["sensors"]["accelerometer"]["verdicts"]["non_finite"] == 10
    assert run(source=out)["output_sha256"] == lying["output_sha256"]
    first = McapLog(out, assembly.layout).config_text.splitlines()[0]
    assert first == (
        "# injected into these readings, seed 3: ultrasonic.bias=0.5@1+1 accelerometer.nan@2+0.01"
    )


def test_a_fault_behind_the_end_is_a_warning(run):
    assert any("met no reading" in warning for warning in run("ultrasonic.stuck@99")["warnings"])


def test_the_command_takes_several_and_names_a_mistake(log):
    """As an operator types it: exit 0 with both in the outcome, exit 2 with what was meant."""

    def replay(*words: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "fusiond.cli", "replay", str(log), str(CONFIG), *words]
        return subprocess.run(command, capture_output=True, text=True, timeout=240, check=False, cwd=PROJECT)

    both = ["--inject", "ultrasonic.bias=0.5@1", "--inject", "accelerometer.stuck@2+0.5"]
    done = replay(*both, "--seed", "7", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["injected"] == {"faults": both[1::2], "seed": 7}
    wrong = replay("--inject", "ultrasonic.bias@1")
    assert wrong.returncode == 2
    assert wrong.stderr.startswith("inject ultrasonic.bias@1: bias needs a size")
