"""What a demonstration with faults shows and asks: the parts that need no second process."""

from __future__ import annotations

import io
import subprocess
import sys

import pytest
from rich.console import Console

from fusiond.demo.plant import LivePlant
from fusiond.demo.plants import lying_rig
from fusiond.demo.scene import Scene, Setting
from fusiond.demo.verdict import Check, Verdict, loss_check, without_promise
from fusiond.demo.view import line, panel
from fusiond.errors import ConfigError
from fusiond.simulation.faults import parse_faults

MS = 1_000_000


def scene_with(*texts: str, t_ms: int) -> Scene:
    places = ("tcp/127.0.0.1:7447", {"daemon": 123456, "plant": 123457})
    scene = Scene(Setting("minicar", 30.0, 2.0, {"position": "m"}, *places, faults=parse_faults(texts)))
    scene.told({"t_ns": t_ms * MS, "position": 1.0, "velocity": 0.0, "acceleration_bias": 0.0})
    return scene


def printed(scene: Scene, columns: int, lines: int) -> str:
    out = io.StringIO()
    Console(file=out, width=columns, force_terminal=False).print(panel(scene, columns, lines))
    return out.getvalue()


BIAS = "ultrasonic.bias=0.5@10+5"


@pytest.mark.parametrize(("t_ms", "on"), [(9_990, False), (10_000, True), (14_970, True), (15_000, False)])
def test_a_fault_is_shown_while_it_is_injected(t_ms, on):
    """From START until the end of DURATION, by the plant's own time, in the line and in the panel."""
    scene = scene_with(BIAS, t_ms=t_ms)
    assert (f"INJECTING {BIAS} (since 10 s until 15 s)" in line(scene)) is on
    assert (f"injecting {BIAS} (since 10 s until 15 s)" in printed(scene, 100, 24)) is on


def test_a_spike_is_shown_for_a_second():
    shown = {
        t: bool(scene_with("ultrasonic.spike=1@5", t_ms=t).injected_now) for t in (4_990, 5_000, 5_990, 6_000)
    }
    assert shown == {4_990: False, 5_000: True, 5_990: True, 6_000: False}


@pytest.mark.parametrize(("columns", "lines"), [(80, 22), (100, 24)])
def test_the_panel_still_fits_its_terminal(columns, lines):
    text = printed(scene_with("ultrasonic.stuck@1", t_ms=2_000), columns, lines)
    assert len(text.splitlines()) < lines
    assert max(map(len, text.splitlines())) <= columns


def test_the_plant_sends_what_its_sensors_make_of_it():
    """In 100 ms: no ultrasonic reading from 50 ms on, every acceleration 1 m/s^2 too much, the truth as it was."""
    sent = {name: [] for name in ("accelerometer", "ultrasonic", "applied")}

    def plant(*inject: str) -> LivePlant:
        rig = lying_rig("minicar", 0, inject)
        publish = {name: lambda z, t, name=name: sent[name].append((t, z[0])) for name in sent}
        command = {"epoch": 1, "seq": 1, "u": {"force": 0.5}, "valid": True}
        return LivePlant(
            rig, publish, lambda: command, lambda told: None, now_ns=lambda: 0, sleep=lambda s: None
        )

    honest = plant()
    honest.run(100)
    before = {name: list(what) for name, what in sent.items()}
    for what in sent.values():
        what.clear()
    lying = plant("ultrasonic.broken@0.05", "accelerometer.bias=1@0", "applied.bias=2@0")
    lying.run(100)
    assert lying.truth == honest.truth
    assert sent["ultrasonic"] == [one for one in before["ultrasonic"] if one[0] < 50 * MS]
    assert sent["accelerometer"] == [(t, z + 1.0) for t, z in before["accelerometer"]]
    assert sent["applied"] == [(0, 2.5)]
    assert lying.sent == {"accelerometer": 100, "ultrasonic": 2, "applied": 1}


def test_what_is_promised_of_honest_sensors_is_measured_and_not_asked():
    check = without_promise(Check("goal", False, "9 mm RMS"))
    assert check == Check("goal", None, "9 mm RMS; promised of honest sensors only")
    assert Verdict((check,)).ok


@pytest.mark.parametrize(("used", "rejected", "ok"), [(100, 0, True), (90, 10, True), (90, 9, False)])
def test_a_lying_sensors_readings_may_be_rejected_but_not_lost(used, rejected, ok):
    sensor = {"used": used, "rejected": rejected, "late": 0, "lost": 0, "refused": {}}
    status = {"sensors": {"ultrasonic": sensor}, "queue": {"dropped": 0}}
    end = {"sent": {"ultrasonic": 100}, "paused_s": 0.0}
    assert loss_check(end, status, lied=True).ok is ok
    assert loss_check(end, status).ok is (used == 100)


def test_a_fault_of_no_sensor_is_the_operators_mistake():
    with pytest.raises(ConfigError, match="no sensor `ultrasonc`; did you mean `ultrasonic`"):
        lying_rig("minicar", 0, ["ultrasonc.bias=1@0"])


def test_the_whole_story_is_told_with_real_processes():
    """Three seconds of plant and daemon: faults are shown while they are on, found and named; the run is repeatable."""
    words = [
        "--for",
        "3",
        "--inject",
        BIAS.replace("@10+5", "@0.5+2"),
        "--inject",
        "accelerometer.nan@1+0.01",
    ]
    done = subprocess.run(
        [sys.executable, "-m", "fusiond.cli", "demo", *words],
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    told = [one for one in done.stdout.splitlines() if " s | " in one]
    assert any("INJECTING ultrasonic.bias=0.5@0.5+2 (since 0.5 s until 2.5 s)" in one for one in told)
    assert "INJECTING" not in told[-1]
    assert any("faulty (bias +0.5" in one for one in told)
    assert "holds: found ultrasonic.bias=0.5@0.5+2: after 0.0" in done.stdout
    assert "holds: found accelerometer.nan@1+0.01: after 0.001 s as garbage" in done.stdout
    assert "holds: nobody else" in done.stdout
    assert "holds: no loss: every reading sent was taken: 3000 accelerometer, 101 ultrasonic" in done.stdout
    assert "holds: repeatable" in done.stdout
