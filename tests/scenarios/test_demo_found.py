"""The end of a demonstration that lies: was each fault found, called by its name, and how far off was the size."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from fusiond.demo.found import found_check, found_checks
from fusiond.demo.scene import Scene, Setting
from fusiond.demo.view import line, panel
from fusiond.recording.summary import SensorSummary, Summary
from fusiond.simulation.faults import parse_fault, parse_faults

BIAS = "ultrasonic.bias=0.5@10+5"


def entry(kind="bias", *, onset_s=10.02, detected_s=10.05, cleared_s=None, size=0.5, std=0.01, others=()):
    """Something that was found."""
    return {
        "kind": kind, "channel": 0, "onset_s": onset_s, "size": size, "size_std": std, "unit": "m",
        "ambiguous_with": list(others), "detected_s": detected_s, "cleared_s": cleared_s,
    }  # fmt: skip


def summary_of(**faults):
    sensors = {
        name: SensorSummary(1, 0, 0, "healthy", None, {}, tuple(found))
        for name, found in ({"ultrasonic": (), "accelerometer": ()} | faults).items()
    }
    return Summary(2, 0.1, {}, None, None, 0, 0, sensors, {}, 0, "", "")


def test_a_fault_that_was_found_says_after_how_long_and_how_far_off():
    check = found_check(parse_fault(BIAS), [entry(size=0.49, cleared_s=15.5)], 30.0)
    assert check.ok is True
    assert check.text == (
        "after 0.050 s as bias +0.49 +-0.01 m since 10.020 s; size off by -0.01 (1.0 std), onset by +0.020 s, "
        "taken back 0.50 s after its end"
    )


@pytest.mark.parametrize(
    ("spec", "kind", "ok"),
    [
        (BIAS, "bias", True),
        (BIAS, "drift", False),
        ("ultrasonic.broken@10+5", "silent", True),
        ("ultrasonic.intermittent=0.1@10", "silent", True),
        ("ultrasonic.nan@10+5", "garbage", True),
        ("ultrasonic.nan@10+5", "silent", False),
        ("ultrasonic.bias=0@10+5", "bias", None),
        ("ultrasonic.spike=1@10", "bias", None),
    ],
)
def test_a_fault_is_to_be_called_by_the_name_it_is_reported_by(spec, kind, ok):
    check = found_check(parse_fault(spec), [entry(kind)], 30.0)
    assert check.ok is ok
    if ok is False:
        assert kind in check.text


@pytest.mark.parametrize(
    "other",
    [
        entry(onset_s=3.0, detected_s=10.05),
        entry(onset_s=9.9, detected_s=9.95),
        entry(onset_s=17.0, detected_s=17.2),
    ],
)
def test_what_was_wrong_before_or_long_after_is_not_this_fault(other):
    check = found_check(parse_fault(BIAS), [other], 30.0)
    assert (check.ok, check.text) == (False, "not found within 5.00 s")


def test_a_run_that_ended_too_early_is_not_asked():
    assert found_check(parse_fault(BIAS), [], 8.0).ok is None


def test_a_sensor_that_did_not_lie_is_to_be_left_alone():
    faults = parse_faults([BIAS])
    good = found_checks(faults, summary_of(ultrasonic=[entry()]), 30.0, detects=True)
    assert [check.ok for check in good] == [True, True]
    wrong = found_checks(
        faults, summary_of(ultrasonic=[entry()], accelerometer=[entry()]), 30.0, detects=True
    )
    assert [check.ok for check in wrong] == [True, False]
    assert wrong[1].text == "accelerometer bias +0.5 +-0.01 m since 10.020 s"


def test_where_nobody_looks_nothing_is_asked():
    (check,) = found_checks(parse_faults([BIAS]), summary_of(), 30.0, detects=False)
    assert check.ok is None
    assert "[faults]" in check.text


@pytest.mark.parametrize(("columns", "lines"), [(80, 22), (100, 24)])
def test_the_panel_shows_what_is_injected_beside_what_is_found(columns, lines):
    places = ("tcp/127.0.0.1:7447", {"daemon": 123456, "plant": 123457})
    scene = Scene(Setting("minicar", 30.0, 2.0, {"position": "m"}, *places, faults=parse_faults([BIAS])))
    scene.told({"t_ns": 11 * 10**9, "position": 1.0, "velocity": 0.0, "acceleration_bias": 0.0})
    counts = {"rate_hz": 33.0, "used": 9, "rejected": 1, "late": 0, "lost": 0, "refused": {}}
    scene.status = {"sensors": {"ultrasonic": counts | {"health": "faulty", "fault": entry()}}}
    out = io.StringIO()
    Console(file=out, width=columns, force_terminal=False).print(panel(scene, columns, lines))
    rows = out.getvalue().splitlines()
    assert len(rows) < lines
    injected, found = (next(r for r in rows if r.startswith(f"│ {word}")) for word in ("injecting", "found"))
    assert BIAS in injected
    assert "ultrasonic bias +0.5 +-0.01 m since 10.020 s" in found
    assert any(("faulty: bias" if columns == 100 else "faulty") in row for row in rows)
    assert "faulty (bias +0.5 +-0.01 m since 10.020 s)" in line(scene)
