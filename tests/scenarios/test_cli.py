"""What an operator meets at the command line: results, refusals, exit codes, and logs that are never lost."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from fusiond.assembly.assembly import load
from fusiond.cli import main
from fusiond.control.catalogue import LAWS
from fusiond.errors import ConfigError
from fusiond.models.catalogue import PROCESSES, SENSORS
from fusiond.recording.mcap_writer import keep_existing

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
MINICAR = CONFIGS / "minicar.toml"
LOG = "t_s,sensor,z0\n0.0,ultrasonic,0.01\n0.001,accelerometer,0.1\n0.03,ultrasonic,-0.01\n"


@pytest.fixture
def command(monkeypatch, capsys):
    """Run one command; returns its exit status, stdout and stderr."""

    def run(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["fusiond", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            main()
        said = capsys.readouterr()
        return int(ended.value.code or 0), said.out, said.err

    return run


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(LOG, encoding="utf-8")
    return path


def test_replay_prints_one_object_and_writes_a_run_that_replays_the_same(command, log, tmp_path):
    run = tmp_path / "run.mcap"
    status, out, _ = command("replay", log, MINICAR, "--out", run, "--json")
    assert status == 0
    first = json.loads(out)
    assert first["sensors"]["ultrasonic"]["used"] == 2
    status, out, _ = command("replay", run, MINICAR, "--json")
    assert (status, json.loads(out)["output_sha256"]) == (0, first["output_sha256"])


def test_the_plain_outcome_names_its_hash(command, log):
    status, out, _ = command("replay", log, MINICAR)
    assert status == 0
    assert "output_sha256" in out


def test_a_log_is_never_written_over_itself(command, log):
    status, _, err = command("replay", log, MINICAR, "--out", log)
    assert status == 2
    assert "is the log itself" in err
    assert log.read_text(encoding="utf-8") == LOG


def test_a_log_of_another_configuration_is_no_success(command, log):
    status, _, err = command("replay", log, CONFIGS / "wall_robot.toml")
    assert status == 2
    assert "no reading was used" in err


def test_import_says_what_came_out(command, tmp_path):
    source, mapping, out = tmp_path / "drive.csv", tmp_path / "map.toml", tmp_path / "drive.mcap"
    source.write_text("time,x\n0.0,1.0\n0.1,1.1\n", encoding="utf-8")
    mapping.write_text(
        '[sensor.y1]\ntime = "time"\nvalues = [{ from = "x", name = "x" }]\n', encoding="utf-8"
    )
    status, said, err = command("import", source, mapping, out)
    assert (status, err) == (0, "")
    assert "y1: 2" in said


def test_a_missing_source_leaves_the_output_alone(command, tmp_path):
    kept = tmp_path / "kept.mcap"
    kept.write_bytes(b"precious")
    mapping = tmp_path / "map.toml"
    mapping.write_text(
        '[sensor.y1]\ntime = "time"\nvalues = [{ from = "x", name = "x" }]\n', encoding="utf-8"
    )
    status, _, err = command("import", tmp_path / "nowhere.bag", mapping, kept)
    assert status == 2
    assert "is not there" in err
    assert kept.read_bytes() == b"precious"


def test_a_recording_that_is_there_is_moved_aside(tmp_path):
    run = tmp_path / "run.mcap"
    assert keep_existing(run) is None
    for number in (1, 2):
        run.write_bytes(bytes([number]))
        assert keep_existing(run) == tmp_path / f"run-{number}.mcap"
    assert (tmp_path / "run-1.mcap").read_bytes() == b"\x01"


def test_a_mistake_inside_a_users_model_names_its_file_and_line(tmp_path):
    (tmp_path / "own.py").write_text(
        "from fusiond.models.contract import Process\nfrom fusiond.types import Slot\n"
        "def describe():\n    return Process(states=(Slot('x'),), noises=1)\n"
        "def transition(x, u, dt_s, p, x_next, F, B):\n    x_next[0] = y\n"
        "def noise(x, dt_s, p, G, q):\n    pass\n",
        encoding="utf-8",
    )
    config = tmp_path / "own.toml"
    config.write_text(
        'name = "own"\n[model]\nfile = "own.py"\n[initial]\nstd = { x = 1.0 }\n'
        '[sensor.s]\nkind = "direct"\nslots = ["x"]\nnoise_std = { x = 1.0 }\n',
        encoding="utf-8",
    )
    with pytest.raises(ConfigError, match=r"own\.py: fails when called \(NameError: .*line 6\); correct"):
        load(config)


def test_schema_and_check_speak_json(command):
    status, out, _ = command("config", "schema")
    assert (status, json.loads(out)["title"]) == (0, "Config")
    status, out, _ = command("check", MINICAR, "--json")
    assert status == 0
    assert json.loads(out)["observability"]["rank"] == 3


def test_every_kind_is_listed_and_tells_what_it_takes(command):
    """A line for each; of one, each of its parameters, those without a default to be filled in."""
    listed = command("config", "kinds")[1]
    for kind in (*PROCESSES, *SENSORS, *LAWS):
        assert f" {kind} " in listed
        assert f'= "{kind}"' in command("config", "kinds", kind)[1]
    told = command("config", "kinds", "planar_robot")[1]
    assert "acceleration_noise_m_s2_sqrt_hz = ?  # float" in told
    assert "max_step_s = 0.1" in told
    status, _, err = command("config", "kinds", "gps")
    assert (status, "did you mean `gps_course` or `gps_position`?" in err) == (2, True)
