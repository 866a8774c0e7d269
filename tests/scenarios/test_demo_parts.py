"""The parts of the demonstration that need no second process: pacing, verdict, display."""

from __future__ import annotations

import dataclasses
import io
import json
import math
import sys

import numpy as np
import pytest
from rich.console import Console

from fusiond.demo import chart
from fusiond.demo.displays import Lines, Panel, display_for
from fusiond.demo.plant import LivePlant
from fusiond.demo.plants import config_of
from fusiond.demo.processes import Process, ProcessFailed
from fusiond.demo.scene import Scene, Setting
from fusiond.demo.unsteered import UNSTEERED, Playing, run_of
from fusiond.demo.verdict import (
    Check,
    Verdict,
    consistency_check,
    end_check,
    goal_check,
    loss_check,
    without_trailing_ticks,
)
from fusiond.demo.view import WIDTH, line, panel, verdict_lines
from fusiond.errors import ConfigError
from fusiond.recording.summary import SensorSummary, Summary
from fusiond.recording.truth import Truth
from fusiond.simulation.rig import birotor, minicar
from fusiond.types import TICK

MS = 1_000_000


class Clock:
    """A clock that moves only when somebody sleeps, or when told."""

    def __init__(self) -> None:
        self.t_ns = 7 * MS
        self.slept: list[float] = []

    def now_ns(self) -> int:
        return self.t_ns

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.t_ns += round(seconds * 1e9)


def live(rig, command=lambda: None):
    """A plant on a clock of our own, and what it published by sensor as (z, t_ns)."""
    heard = {"accelerometer": [], "ultrasonic": [], "applied": []}
    clock = Clock()
    plant = LivePlant(
        rig, {name: lambda z, t, name=name: heard[name].append((z, t)) for name in heard}, command,
        lambda told: None, now_ns=clock.now_ns, sleep=clock.sleep,
    )  # fmt: skip
    return plant, heard, clock


# the plant


def test_the_plant_keeps_pace_and_its_stamps_are_whole_milliseconds():
    plant, heard, clock = live(minicar(0))
    plant.run(300)
    assert clock.t_ns == 307 * MS
    assert [t for _, t in heard["accelerometer"]] == [k * MS for k in range(1, 301)]
    assert [t for _, t in heard["ultrasonic"]] == [k * 30 * MS for k in range(11)]
    assert plant.sent == {"accelerometer": 300, "ultrasonic": 11, "applied": 0}


def test_a_plant_that_was_stopped_catches_up_a_second_and_pauses_the_rest():
    """After 1.2 s without the processor: 1 s in a burst, 0.2 s lost to the wall, no stamp touched."""
    plant, heard, clock = live(minicar(0))
    sent_before = []

    def stall(z, t_ns):
        heard["accelerometer"].append((z, t_ns))
        if t_ns == 100 * MS:
            clock.t_ns += 1201 * MS
            sent_before.append(len(clock.slept))
        if t_ns == 1100 * MS:
            sent_before.append(len(clock.slept))

    plant.publish = {**plant.publish, "accelerometer": stall}
    plant.run(1300)
    assert plant.paused_ns == 200 * MS
    assert plant.worst_behind_ns == 1200 * MS
    assert sent_before[0] == sent_before[1]
    assert clock.t_ns == (7 + 1300 + 200) * MS
    assert [t for _, t in heard["accelerometer"]] == [k * MS for k in range(1, 1301)]


def test_commands_are_followed_once_and_answered():
    """A new command acts from the next millisecond on and is answered with its stamp; the same one is not again."""
    said = {"epoch": 1, "seq": 1, "u": {"force": 0.5}, "valid": True}
    plant, heard, _ = live(minicar(0), lambda: said)
    plant.run(10)
    assert heard["applied"] == [((0.5,), 0)]
    assert plant.rig.state.velocity_m_s == pytest.approx(0.5 * 0.010)


def test_a_command_that_is_not_valid_lets_the_plant_stand():
    said = {"epoch": 1, "seq": 1, "u": {"force": 0.0}, "valid": False}
    plant, heard, _ = live(birotor(0), lambda: said)
    plant.run(10)
    assert heard["applied"] == [((pytest.approx(0.5 * 9.81),), 0)]
    assert plant.rig.state.velocity_m_s == pytest.approx(0.0, abs=1e-12)


def test_before_the_first_command_somebody_holds_the_birotor():
    plant, _, _ = live(birotor(0))
    plant.run(50)
    assert plant.rig.state.position_m == pytest.approx(2.0, abs=1e-12)


@pytest.mark.parametrize("name", UNSTEERED)
def test_a_run_is_sent_at_its_stamps_and_its_truth_told(name):
    """Every reading in order, never before its time; every row of truth, never before it is true."""
    clock, heard, told = Clock(), [], []
    run = run_of(name, 0, 2.0, [])
    sensors = {reading.sensor for reading in run.readings}
    publish = {s: lambda z, t, s=s: heard.append((clock.t_ns, t, s, z)) for s in sensors}
    tell = lambda line: told.append((clock.t_ns, line))  # noqa: E731 (beside the one above)
    playing = Playing(run, 2000 * MS, publish, tell, clock.now_ns, clock.sleep)
    playing.play()
    assert [(t, s, z) for _, t, s, z in heard] == [(r.t_ns, r.sensor, r.z) for r in run.readings]
    assert all(now == 7 * MS + t for now, t, _, _ in heard)
    assert [line["t_ns"] for _, line in told] == run.truth.t_ns.tolist()
    assert all(now >= 7 * MS + line["t_ns"] for now, line in told)
    assert clock.t_ns == 2007 * MS
    end = playing.summary()
    assert (end["t_ns"], sum(end["sent"].values())) == (2000 * MS, len(run.readings))


def test_the_sensors_of_a_run_can_lie():
    honest, lying = run_of("square_robot", 0, 2.0, []), run_of("square_robot", 0, 2.0, ["encoders.bias=1@1"])
    apart = lying.of("encoders")[1] - honest.of("encoders")[1]
    assert apart[99].tolist() == [0.0, 0.0]
    assert apart[101] == pytest.approx([1.0, 1.0])
    with pytest.raises(ConfigError, match="lidar"):
        run_of("square_robot", 0, 2.0, ["lidar.bias=1@1"])


# the verdict


def truth_at(offset_m: float, duration_s: float) -> Truth:
    """At the goal of 2 m but for an offset, every 10 ms."""
    t_ns = np.arange(0, round(duration_s * 100) + 1, dtype=np.int64) * 10 * MS
    return Truth(t_ns, ("position",), np.full((len(t_ns), 1), 2.0 + offset_m), np.array([False]))


def summary_of(nis_mean: float = 1.0, nees_mean: float = 3.0) -> Summary:
    sensor = SensorSummary(
        used=1000, rejected=0, late=0, health="healthy", nis_mean=nis_mean, verdicts={"used": 1000}
    )
    return Summary(
        readings=1000, wall_s=1.0, final={}, rmse={}, nees_mean=nees_mean, nees_dof=3, compared=1000,
        sensors={"ultrasonic": sensor}, refused={}, resets=0, output_sha256="", state_sha256="",
    )  # fmt: skip


END = {"sent": {"ultrasonic": 100}, "paused_s": 0.0}


def status_of(**changes: int):
    sensor = {
        "used": 100,
        "rejected": 0,
        "late": 0,
        "lost": 0,
        "refused": {},
        "rate_hz": 33.0,
        "health": "healthy",
    }
    return {"sensors": {"ultrasonic": {**sensor, **changes}}, "queue": {"dropped": 0}}


def test_the_goal_is_held_within_two_and_a_half_millimetres():
    """Over the last ten seconds of seed 0; another seed's noise, or a shorter stay, is allowed 8 mm."""
    assert goal_check(truth_at(0.0024, 30.0), 2.0, seed=0).ok is True
    assert goal_check(truth_at(0.0026, 30.0), 2.0, seed=0).ok is False
    assert goal_check(truth_at(-0.0026, 25.0), 2.0, seed=0).ok is False
    assert goal_check(truth_at(0.0079, 30.0), 2.0, seed=1).ok is True
    assert goal_check(truth_at(0.0081, 30.0), 2.0, seed=1).ok is False
    assert goal_check(truth_at(0.0079, 24.0), 2.0, seed=0).ok is True
    assert goal_check(truth_at(-0.0081, 18.0), 2.0, seed=0).ok is False


def test_a_run_too_short_to_reach_the_goal_is_not_asked():
    assert goal_check(truth_at(1.0, 17.9), 2.0, seed=0).ok is None


@pytest.mark.parametrize(
    ("nis_mean", "nees_mean", "ok"),
    [(1.0, 3.0, True), (1.16, 3.0, False), (0.85, 3.0, False), (1.0, 17.0, False), (1.14, 16.0, True)],
)
def test_consistency_is_held_on_both_sides(nis_mean, nees_mean, ok):
    """1000 readings: NIS between 0.859 and 1.153 (chi-square, 99.9 %), NEES below 16.3."""
    assert consistency_check(summary_of(nis_mean, nees_mean), {"ultrasonic": 1}).ok is ok


@pytest.mark.parametrize(
    "changes",
    [
        {"used": 99},
        {"used": 99, "rejected": 1},
        {"used": 99, "late": 1},
        {"lost": 1},
        {"refused": {"bad_crc": 1}},
    ],
)
def test_one_reading_that_is_missing_fails_the_verdict(changes):
    assert loss_check(END, status_of()).ok is True
    assert loss_check(END, status_of(**changes)).ok is False


def test_one_reading_dropped_in_the_queue_fails_the_verdict():
    assert loss_check(END, status_of() | {"queue": {"dropped": 1}}).ok is False


def test_a_part_that_was_not_asked_fails_nothing_and_one_that_fails_fails_all():
    held, unasked, failed = (Check("part", ok, "") for ok in (True, None, False))
    assert Verdict((held, unasked)).ok
    assert not Verdict((held, unasked, failed)).ok


def test_only_ticks_after_the_last_reading_are_left_out():
    def events(*sensors: int):
        made = np.zeros(len(sensors), np.dtype([("sensor", "<i4")]))
        made["sensor"] = sensors
        return made

    chunks = [events(0, TICK), events(TICK), events(TICK, 1, TICK), events(TICK)]
    kept = [sensor for chunk in without_trailing_ticks(chunks) for sensor in chunk["sensor"].tolist()]
    assert kept == [0, TICK, TICK, TICK, 1]


# processes and configurations


def test_a_process_that_fails_shows_its_last_words():
    program = "import sys; print('hello', flush=True); sys.stderr.write('no such sensor\\n'); sys.exit(3)"
    with Process("daemon", [sys.executable, "-c", program]) as process:
        assert process.line(30.0) == "hello"
        with pytest.raises(ProcessFailed, match=r"the daemon ended with status 3(.|\n)*no such sensor"):
            process.line(30.0)


def test_a_process_that_will_not_stop_is_made_to():
    program = "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); print('deaf', flush=True); signal.pause()"
    process = Process("plant", [sys.executable, "-c", program])
    assert process.line(30.0) == "deaf"
    assert process.end(patience_s=0.1) == -9


def test_a_configuration_here_goes_before_the_packages_own(tmp_path, monkeypatch):
    (tmp_path / "configs").mkdir()
    (tmp_path / "configs" / "minicar.toml").write_text("name = 'minicar'\n")
    monkeypatch.chdir(tmp_path)
    assert config_of("minicar").resolve() == tmp_path / "configs" / "minicar.toml"
    assert config_of("birotor").is_absolute()
    with pytest.raises(ConfigError, match=r"hovercraft\.toml is not in configs or "):
        config_of("hovercraft")


# the display


def scene_of(error_m: float = 0.001) -> Scene:
    units = {"position": "m", "velocity": "m_s", "acceleration_bias": "m_s2"}
    scene = Scene(
        Setting("minicar", 30.0, 2.0, units, "tcp/127.0.0.1:7447", {"daemon": 123456, "plant": 123457})
    )
    for k in range(1, 101):
        truth = {"position": 0.02 * k, "velocity": 1.0, "acceleration_bias": -0.97}
        state = truth | {"position": truth["position"] + error_m}
        t_ns = k * 30 * MS
        scene.told({"t_ns": t_ns, **truth})
        std = dict.fromkeys(units, 0.002)
        scene.estimated({"t": t_ns / 1e9, "t_ns": t_ns, "state": state, "std": std, "health": "nominal"})
    scene.control = {"u": {"force": -0.25}, "valid": True}
    scene.status = status_of()
    return scene


def printed(renderable: object) -> str:
    out = io.StringIO()
    Console(file=out, width=WIDTH + 10, force_terminal=False).print(renderable)
    return out.getvalue()


@pytest.mark.parametrize(("columns", "lines"), [(80, 22), (80, 24), (99, 60), (100, 24), (200, 25)])
def test_the_panel_fits_its_terminal_and_cuts_nothing_off(columns, lines):
    text = printed(panel(scene_of(), columns, lines))
    assert "…" not in text
    assert len(text.splitlines()) < lines
    assert max(map(len, text.splitlines())) <= columns
    assert "error in 3 sigma" in text


def test_the_panel_shows_estimate_truth_and_error():
    text = printed(panel(scene_of()))
    assert "2.00000" in text
    assert "2.00100" in text
    assert "±0.00600" in text
    assert "+0.00100" in text
    assert "goal 2 m" in text
    assert "ultrasonic" in text


def test_the_panel_can_be_drawn_before_anything_was_heard():
    assert "waiting" in printed(panel(Scene(scene_of().setting)))


def test_a_plain_line_says_the_same_in_ascii():
    text = line(scene_of())
    assert text.isascii()
    assert "position 2.00100 +-0.00600 m" in text
    assert "error +1.00 mm" in text


def test_the_truth_is_matched_by_time_whichever_comes_first():
    late = Scene(scene_of().setting)
    estimate = {
        "t": 0.03,
        "t_ns": 30 * MS,
        "state": {"position": 1.5},
        "std": {"position": 0.1},
        "health": "nominal",
    }
    late.estimated(estimate)
    assert late.error("position") is None
    late.told({"t_ns": 60 * MS, "position": 9.0})
    assert late.error("position") is None
    late.told({"t_ns": 30 * MS, "position": 1.0})
    assert late.error("position") == pytest.approx(0.5)


def test_a_verdict_that_fails_says_so():
    failed = Verdict((Check("goal", False, "off"), Check("consistent", None, "short")))
    text = printed(verdict_lines(failed))
    assert "FAILS" in text
    assert "verdict: FAILED" in text
    assert json.loads(json.dumps(failed.json_object())) == {
        "ok": False,
        "checks": [
            {"name": "goal", "ok": False, "text": "off"},
            {"name": "consistent", "ok": None, "text": "short"},
        ],
    }


def test_a_dumb_terminal_and_a_file_get_lines(monkeypatch):
    class Utf8(io.StringIO):
        encoding = "utf-8"

    monkeypatch.setenv("TERM", "xterm-256color")
    assert isinstance(display_for(Console(file=Utf8(), force_terminal=True, width=80, height=24)), Panel)
    assert isinstance(display_for(Console(file=Utf8(), force_terminal=True, width=79, height=24)), Lines)
    assert isinstance(display_for(Console(file=Utf8(), force_terminal=False)), Lines)
    monkeypatch.setenv("TERM", "dumb")
    assert isinstance(display_for(Console(file=Utf8(), force_terminal=True)), Lines)


def test_a_curve_goes_through_its_points():
    """Rising from the lower left to the upper right corner of two cells by one."""
    assert chart.curve([(0.0, 0.0), (1.0, 1.0)], 1.0, (0.0, 1.0), 2, 1) == [
        chr(0x2800 + 0x40) + chr(0x2800 + 0x08)
    ]


def test_neighbouring_points_of_a_curve_are_joined():
    """A jump between two columns is drawn through every row between."""
    column = chart.curve([(0.0, 0.0), (0.9, 1.0)], 9.0, (0.0, 1.0), 4, 2)
    filled = sum(bin(ord(cells[0]) - 0x2800).count("1") for cells in column if cells[0] != " ")
    assert filled == 8


@pytest.mark.parametrize(
    ("value", "drawn"),
    [
        (0.0, "──●──"),
        (1.0, "──┼─●"),
        (-0.5, "─●┼──"),
        (1.6, "──┼─▶"),
        (-9.0, "◀─┼──"),
        (float("nan"), "──●──"),
    ],
)
def test_a_deviation_stands_where_it_belongs(value, drawn):
    assert chart.deviation(value, 1.0, half=2) == drawn


# a system nobody steers


def summary_at(x: float, yaw: float) -> Summary:
    final = {"state": {"x": x, "yaw": yaw, "felt": 0.0}, "std": {"x": 0.1, "yaw": 0.01}}
    return dataclasses.replace(summary_of(), final=final)


@pytest.mark.parametrize(
    ("x", "yaw", "holds"),
    [
        (1.0, 3.14, True),
        (1.3, -3.14, True),
        (1.5, 3.14, False),
        (1.0, 3.0, False),
        (float("nan"), 3.14, False),
    ],
)
def test_the_end_is_held_against_its_own_standard_deviation(x, yaw, holds):
    """Every state within 3.5 of its own standard deviations, angles the short way round."""
    truth = Truth(
        np.array([0, MS], dtype=np.int64), ("x", "yaw"), np.array([[0.0, 0.0], [1.0, 3.14]]), np.array([False, True])
    )  # fmt: skip
    assert end_check(summary_at(x, yaw), truth).ok is holds


def test_a_filter_less_sure_than_it_could_be_is_held_from_above_only_where_that_is_said():
    quiet = summary_of(nis_mean=0.5)
    assert consistency_check(quiet, {"ultrasonic": 1}).ok is False
    assert consistency_check(quiet, {"ultrasonic": 1}, own_noise=False).ok is True
    assert consistency_check(summary_of(nis_mean=1.5), {"ultrasonic": 1}, own_noise=False).ok is False


@pytest.mark.parametrize(("columns", "lines"), [(80, 22), (100, 24), (120, 45)])
def test_the_plan_of_two_states_is_drawn_and_fits(columns, lines):
    """Ten states and a square: no line too many or too long, the states that are watched among those shown."""
    units = {"x": "m", "y": "m", "yaw": "rad"} | {f"other_{k}": "" for k in range(7)}
    scene = Scene(
        Setting("square_robot", 22.0, None, units, "tcp/127.0.0.1:7447", {"daemon": 1, "plant": 2}, watched=("x", "y"))
    )  # fmt: skip
    for k in range(100):
        x, y = 3.0 * min(k, 50) / 50.0, 3.0 * max(k - 50, 0) / 50.0
        scene.told({"t_ns": k * MS, "x": x, "y": y, "yaw": math.pi})
        state = {"x": x, "y": y + 0.1, "yaw": -math.pi} | {f"other_{k}": 0.0 for k in range(7)}
        std = dict.fromkeys(units, 0.1)
        scene.estimated({"t": k * 1e-3, "t_ns": k * MS, "state": state, "std": std, "health": "nominal"})
    console = Console(file=io.StringIO(), width=columns, height=lines)
    console.print(panel(scene, columns, lines))
    drawn = console.file.getvalue().splitlines()
    assert len(drawn) <= lines
    assert any("y over x" in row for row in drawn)
    assert scene.error("yaw") == pytest.approx(0.0, abs=1e-12)
    assert any(row.startswith("│ y m") for row in drawn)
