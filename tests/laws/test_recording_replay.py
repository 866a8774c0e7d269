from __future__ import annotations

import dataclasses
import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from fusiond.assembly.assembly import assemble
from fusiond.config import read
from fusiond.errors import LogError
from fusiond.recording.csv_writer import write_csv
from fusiond.recording.diff import diff
from fusiond.recording.log import open_log
from fusiond.recording.mcap_writer import McapWriter
from fusiond.recording.refusals import Refusals
from fusiond.recording.replay import replay
from fusiond.recording.truth import Truth, read_truth
from fusiond.types import TICK, Verdict
from tests.laws.recording_samples import layout_of

CONFIG = Path(__file__).resolve().parents[2] / "configs" / "minicar.toml"
LAYOUT = layout_of("gps", "imu")


class ScriptedEngine:
    """Answers every reading with the report that stands at its place in a script."""

    repairs = 0

    def guard(self):
        return {}

    def __init__(self, script, covariances):
        self.layout = dataclasses.replace(LAYOUT)
        self.track = np.zeros(1, self.layout.track)
        self.script, self.all_covariances = script, covariances
        self.at = 0

    def process(self, readings, *, covariances=False):
        part = slice(self.at, self.at + len(readings))
        self.at += len(readings)
        self.covariances = self.all_covariances[part]
        return self.script[part]

    def outputs(self, x):
        return {}

    def state_sha256(self):
        return "state"


@pytest.fixture
def script():
    """400 reports over 4 s with known errors: position 0.5 too far, heading across +-pi 0.1 too far."""
    rng = np.random.default_rng(1)
    reports = np.zeros(400, LAYOUT.report)
    reports["t_ns"] = reports["state_t_ns"] = np.arange(400) * 10_000_000
    reports["arrival_ns"] = rng.integers(10**9, size=400)
    reports["sensor"] = rng.choice([TICK, 0, 1], 400)
    reports["verdict"] = rng.choice([0, 0, 0, Verdict.TOO_LATE, Verdict.DUPLICATE], 400)
    reports["dof"], reports["nis"] = 2, rng.chisquare(2, 400)
    t_s = reports["state_t_ns"] / 1e9
    reports["x"][:, 0] = t_s + 0.5
    reports["x"][:, 1] = (3.0 + t_s + 0.1 + np.pi) % (2 * np.pi) - np.pi
    reports["health"] = [0, 5]
    covariances = np.tile(np.diag([0.25, 0.01]), (400, 1, 1))
    return reports, covariances


def truth(end_s: float = 10.0) -> Truth:
    t_s = np.linspace(0.0, end_s, 1001)
    values = np.column_stack([t_s, 3.0 + t_s])
    t_ns = np.round(t_s * 1e9).astype(np.int64)
    return Truth(t_ns, ("position", "heading"), values, np.array([False, True]))


def run(script, chunk=64, **options):
    engine = ScriptedEngine(*script)
    readings = np.zeros(len(script[0]), LAYOUT.reading)
    chunks = (readings[k : k + chunk] for k in range(0, len(readings), chunk))
    return replay(engine, chunks, **options)


def test_rmse_and_nees_are_those_of_the_script(script):
    summary = run(script, truth=truth())
    assert summary.rmse == pytest.approx({"position": 0.5, "heading": 0.1})
    assert summary.nees_mean == pytest.approx(0.25 / 0.25 + 0.01 / 0.01)
    reports, _ = script
    assert summary.compared == np.sum((reports["sensor"] != TICK) & (reports["verdict"] == 0))


def test_only_the_time_that_truth_covers_counts(script):
    reports, _ = script
    reports["x"][reports["state_t_ns"] > 10**9, 0] += 100.0
    assert run(script, truth=truth(1.0)).rmse == pytest.approx({"position": 0.5, "heading": 0.1})


def test_late_rejected_and_ticks_are_no_estimates(script):
    reports, _ = script
    reports["x"][(reports["sensor"] == TICK) | (reports["verdict"] != 0), 0] += 100.0
    assert run(script, truth=truth()).rmse["position"] == pytest.approx(0.5)


def test_used_rejected_and_late_are_the_readings(script):
    reports, _ = script
    summary = run(script)
    for number, name in enumerate(("gps", "imu")):
        mine = reports[reports["sensor"] == number]
        sensor = summary.sensors[name]
        assert sensor.used + sensor.rejected + sensor.late == len(mine)
        assert sensor.used == np.sum(mine["verdict"] == 0)
        assert sensor.late == np.sum(mine["verdict"] == Verdict.TOO_LATE)
        assert sensor.nis_mean == pytest.approx(np.mean(mine["nis"][mine["verdict"] == 0]))
    assert summary.readings == np.sum(reports["sensor"] != TICK)
    assert summary.sensors["imu"].health == "silent"


def test_refusals_of_the_log_and_of_the_engine_are_summed_by_reason(script):
    refusals = Refusals()
    refusals.add(Verdict.UNKNOWN_SENSOR, "line 3: sensor 'lidar'", 5)
    refusals.add(Verdict.DUPLICATE, "line 4")
    reports, _ = script
    refused = run(script, refusals=refusals).refused
    events = reports["sensor"] != TICK
    assert refused["unknown_sensor"] == 5
    assert refused["duplicate"] == np.sum(events & (reports["verdict"] == Verdict.DUPLICATE)) + 1
    assert refused["too_late"] == np.sum(events & (reports["verdict"] == Verdict.TOO_LATE))


def test_the_hash_is_over_all_reports_without_arrival_times(script):
    reports, _ = script
    bare = reports.copy()
    bare["arrival_ns"] = 0
    expected = hashlib.sha256(bare.tobytes()).hexdigest()
    assert run(script).output_sha256 == expected
    assert run(script, chunk=7).output_sha256 == expected
    assert np.any(reports["arrival_ns"])
    reports["std"][200, 1] = 1e-300
    assert run(script).output_sha256 != expected


def test_a_truth_that_shares_no_name_is_an_error(script):
    with pytest.raises(LogError, match="none of which the model has"):
        run(script, truth=dataclasses.replace(truth(), names=("east", "north")))


def test_an_unknown_column_of_truth_is_told(script):
    summary = run(script, truth=dataclasses.replace(truth(), names=("position", "north")))
    assert summary.rmse.keys() == {"position"}
    assert summary.nees_dof == 1
    assert "north" in summary.warnings[0]


def test_the_summary_is_json_with_the_keys_of_the_contract(script):
    content = json.loads(json.dumps(run(script, truth=truth()).json_object(), allow_nan=False))
    assert content.keys() >= {
        "readings", "wall_s", "final", "rmse", "nees_mean", "model", "sensors", "repairs", "output_sha256",
        "state_sha256", "refused", "resets",
    }  # fmt: skip
    assert content["final"].keys() >= {"t_s", "state", "std", "health"}
    sensor = content["sensors"]["gps"]
    assert sensor.keys() >= {"used", "rejected", "late", "health", "nis_mean", "faults"}
    assert "rmse" not in run(script).json_object()


def test_an_empty_log_has_a_summary(script):
    summary = replay(ScriptedEngine(*script), [])
    assert summary.readings == 0
    assert summary.final == {}
    json.dumps(summary.json_object(), allow_nan=False)


@pytest.fixture(scope="module")
def minicar():
    return assemble(read(CONFIG))


@pytest.fixture(scope="module")
def log_path(minicar, tmp_path_factory):
    """Five seconds of the mini car as CSV, with ticks, late and unusable readings."""
    rng = np.random.default_rng(0)
    layout = minicar.layout
    readings = np.zeros(5000, layout.reading)
    readings["t_ns"] = np.arange(5000) * 1_000_000
    readings["sensor"] = layout.numbers["accelerometer"]
    readings["length"] = 1
    readings["z"][:, 0] = rng.normal(scale=0.01, size=5000)
    readings["sensor"][::30] = layout.numbers["ultrasonic"]
    readings["t_ns"][3000:3300:30] -= 20_000_000
    readings["z"][600, 0] = np.nan
    readings["sensor"][7::500] = TICK
    readings["length"][7::500] = 0
    readings["z"][7::500] = 0
    path = tmp_path_factory.mktemp("minicar") / "log.csv"
    write_csv(path, layout, [readings])
    return path


def replayed(minicar, path, out=None):
    log = open_log(path, minicar.layout)
    if out is None:
        return replay(minicar.engine(), log, refusals=log.refusals)
    with McapWriter(out, minicar.layout) as writer:
        return replay(minicar.engine(), log, writer=writer, refusals=log.refusals)


def test_a_log_and_the_run_recorded_from_it_give_the_same_bits(minicar, log_path, tmp_path):
    first = replayed(minicar, log_path, tmp_path / "run.mcap")
    again = replayed(minicar, log_path)
    run = replayed(minicar, tmp_path / "run.mcap")
    assert first.output_sha256 == again.output_sha256 == run.output_sha256
    assert first.state_sha256 == again.state_sha256 == run.state_sha256
    assert first.refused == run.refused
    assert first.refused["non_finite"] == 1
    assert first.readings == 4990


def test_truth_of_states_is_read_for_the_model(minicar, log_path, tmp_path):
    (tmp_path / "truth.csv").write_text("t_s,position\n0,0\n6,0\n")
    log = open_log(log_path, minicar.layout)
    summary = replay(minicar.engine(), log, truth=read_truth(tmp_path / "truth.csv", ()))
    assert 0.0 < summary.rmse["position"] < 0.01
    assert summary.nees_mean > 0.0


def test_two_equal_runs_do_not_differ(minicar, log_path, tmp_path):
    for name in ("a", "b"):
        replayed(minicar, log_path, tmp_path / f"{name}.mcap")
    found = diff(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert found.equal
    assert found.reports == (5000, 5000)
    assert found.largest == {}


def test_diff_finds_the_first_and_the_largest_difference(minicar, log_path, tmp_path):
    replayed(minicar, log_path, tmp_path / "a.mcap")
    lines = log_path.read_text().splitlines()
    ultrasonic = [k for k, line in enumerate(lines) if ",ultrasonic," in line]
    cells = lines[ultrasonic[50]].split(",")
    lines[ultrasonic[50]] = ",".join([*cells[:4], repr(float(cells[4]) + 0.0125)])
    (tmp_path / "b.csv").write_text("\n".join(lines) + "\n")
    replayed(minicar, tmp_path / "b.csv", tmp_path / "b.mcap")

    found = diff(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert not found.equal
    assert found.first.report == ultrasonic[50] - 1
    assert found.first.sensor == "ultrasonic"
    assert found.first.field == "z[0]"
    assert abs(found.first.a - found.first.b) == pytest.approx(0.0125)
    assert found.largest["z[0]"] == pytest.approx(0.0125)
    assert 0.0 < found.largest["x.position"] < 0.0125
    assert found.differing > 100
    assert "ultrasonic" in found.first.text()
    json.dumps(found.json_object())


def test_a_shorter_run_differs(minicar, log_path, tmp_path):
    replayed(minicar, log_path, tmp_path / "a.mcap")
    (tmp_path / "b.csv").write_text("".join(log_path.read_text().splitlines(keepends=True)[:-3]))
    replayed(minicar, tmp_path / "b.csv", tmp_path / "b.mcap")
    found = diff(tmp_path / "a.mcap", tmp_path / "b.mcap")
    assert not found.equal
    assert found.first is None
    assert found.notes == ("3 reports stand only in a.mcap",)


def test_diff_refuses_what_holds_no_reports(minicar, log_path, tmp_path):
    with McapWriter(tmp_path / "a.mcap", minicar.layout):
        pass
    with pytest.raises(LogError, match="holds no reports"):
        diff(tmp_path / "a.mcap", tmp_path / "a.mcap")
