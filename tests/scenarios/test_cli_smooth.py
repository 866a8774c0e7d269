"""`fusiond replay --smooth`: one object for programs, a table for people, a channel for viewers."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from fusiond.recording.mcap_blocks import McapFile
from fusiond.simulation.logs import write_log, write_truth
from fusiond.simulation.registry import simulate
from tests.scenarios.test_cli import CONFIGS, MINICAR, command

__all__ = ["command"]


@pytest.fixture
def drive(tmp_path):
    """Three seconds of the mini car: log and truth."""
    simulation = simulate("minicar", 0, 3.0)
    write_log(tmp_path / "log.csv", simulation)
    write_truth(tmp_path / "truth.csv", simulation.truth)
    return tmp_path / "log.csv", tmp_path / "truth.csv"


def test_the_smoothed_run_is_nearer_to_the_truth_and_stands_beside_the_filters(command, drive, tmp_path):
    log, truth = drive
    out = tmp_path / "run.mcap"
    status, said, err = command("replay", log, MINICAR, "--truth", truth, "--smooth", "--out", out, "--json")
    assert (status, [line for line in err.splitlines() if not line.startswith("compiling ")]) == (0, [])
    run = json.loads(said)
    smoothed = run["smoothed"]
    assert not [warning for warning in run["warnings"] if "smoothed" in warning]
    assert (smoothed["updates"], smoothed["segments"]) == (run["sensors"]["ultrasonic"]["used"], 1)
    assert smoothed["compared"] == run["compared"]
    for name, rmse in run["rmse"].items():
        assert smoothed["rmse"][name] < rmse
        assert smoothed["std"][name] < smoothed["filter_std"][name]
    assert smoothed["nees_dof"] == run["nees_dof"] == 3
    plain = json.loads(command("replay", log, MINICAR, "--truth", truth, "--json")[1])
    assert plain["output_sha256"] == run["output_sha256"]
    assert "smoothed" not in plain
    check_channel(out, run)


def check_channel(out, run):
    """Every update in the order of time: they are slower than `recording.estimate_hz`. The last is the filter's own."""
    messages = [
        json.loads(message.data) for channel, message in McapFile(out).walk() if channel.topic == "smoothed"
    ]
    times = np.array([message["t"] for message in messages])
    assert np.all(np.diff(times) > 0.0)
    assert len(messages) == run["smoothed"]["updates"]
    assert [message["seq"] for message in messages] == list(range(len(messages)))
    assert set(messages[0]["state"]) == set(messages[0]["std"]) == set(run["final"]["state"])
    at_the_end = [
        json.loads(message.data) for channel, message in McapFile(out).walk() if channel.topic == "estimate"
    ][-1]
    assert messages[-1]["t"] == at_the_end["t"]
    assert messages[-1]["state"] == at_the_end["state"]


def test_people_read_both_in_one_table(command, drive):
    log, truth = drive
    status, said, _ = command("replay", log, MINICAR, "--truth", truth, "--smooth")
    assert status == 0
    assert "smoothed: " in said
    assert "mean NEES, smoothed" in said


@pytest.fixture
def walk(tmp_path):
    """A minute at constant velocity: log and truth."""
    simulation = simulate("constant_velocity", 0, 60.0)
    write_log(tmp_path / "log.csv", simulation)
    write_truth(tmp_path / "truth.csv", simulation.truth)
    return tmp_path / "log.csv", tmp_path / "truth.csv"


@pytest.mark.parametrize("fault", ["y1.bias=1@20+10", "y1.spike=3@20+0.1", "y1.broken@20+2"])
def test_a_fault_is_smoothed_as_it_was_judged_in_the_end(command, walk, fault):
    """A bias of ten deviations for 10 s, a spike, 2 s of silence: at most 1.15 times the RMSE without a fault."""
    log, truth = walk
    words = ("replay", log, CONFIGS / "constant_velocity.toml", "--truth", truth, "--smooth", "--json")
    sound, faulty = (json.loads(command(*words, *more)[1]) for more in ((), ("--inject", fault)))
    assert not [warning for warning in sound["warnings"] if "smoothed" in warning]
    assert faulty["smoothed"]["segments"] == 1
    for name, rmse in sound["smoothed"]["rmse"].items():
        assert faulty["smoothed"]["rmse"][name] < 1.15 * rmse
        assert faulty["smoothed"]["rmse"][name] < faulty["rmse"][name]


def test_a_recursion_that_keeps_no_factors_is_refused(command, drive, tmp_path):
    text = re.sub(r"\[faults\][^\[]*", "", MINICAR.read_text(encoding="utf-8"))
    config = tmp_path / "plain.toml"
    config.write_text(text + '\n[filter]\nrecursion = "conventional"\n', encoding="utf-8")
    status, _, err = command("replay", drive[0], config, "--smooth")
    assert status == 2
    assert err.startswith("--smooth: ")
