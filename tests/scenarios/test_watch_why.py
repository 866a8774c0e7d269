"""What `why` and `watch` print, from answers as a daemon gives them."""

from __future__ import annotations

import io

import pytest
from rich.console import Console

from fusiond.cli.explaining import found_lines, show_why
from fusiond.cli.watch_view import condition, event_text, panel, plain_line
from fusiond.cli.watching import Watched

FAULT = {
    "kind": "bias", "channel": 0, "onset_s": 5.01, "size": 0.4889, "size_std": 0.0073, "unit": "m",
    "ambiguous_with": [],
}  # fmt: skip
SILENT = FAULT | {"kind": "silent", "channel": None, "size": 0.0, "size_std": 0.0, "unit": ""}


def reading(t_s, **other):
    return {
        "t_s": t_s, "delay_s": 0.0021, "z": [2.67], "nu": [0.4936], "S": [1.054e-4], "nis": 2311.0, "dof": 1,
        "limit": 23.93, "R_used": [1e-4], "R_declared": [1e-4], "verdict": "gated", "health": "healthy",
        "fault": None, "action": "none",
    } | other  # fmt: skip


def answer(*readings, at_s=None):
    turns = [{"t_s": 5.04, "to": "faulty", "fault": FAULT}]
    return {
        "sensor": "ultrasonic", "role": "update", "at_s": at_s, "covers_s": [0.0, 9.0] if readings else None,
        "turns": turns, "readings": list(readings),
    }  # fmt: skip


def shown(what, width=170):
    out = io.StringIO()
    show_why(what, Console(file=out, width=width))
    return out.getvalue().splitlines()


def test_a_decision_is_one_row_with_everything_it_was_made_of():
    rows = shown(answer(reading(5.01), reading(5.04, health="faulty", fault=FAULT, limit=None)))
    assert rows[0] == "ultrasonic (update): kept from 0.000 to 9.000 s"
    assert rows[1] == "  5.040 s  faulty: bias +0.4889 +-0.0073 m since 5.010 s"
    head = "stamp s delay ms z nu S R used R declared nis limit verdict health fault"
    assert rows[2].split() == head.split()
    row = "5.010 2.1 2.67 0.4936 0.0001054 0.0001 0.0001 2311 23.93 gated healthy"
    assert rows[3].split() == row.split()
    assert "-  gated    faulty   bias +0.4889 +-0.0073 m since 5.010 s" in rows[4]


def test_a_terminal_of_80_columns_shows_every_row_whole():
    """Stamps of the day and verdicts are not cut off; what is left out is said."""
    rows = shown(answer(reading(1795834605.01, health="faulty", fault=FAULT)), width=80)
    assert rows[2].split() == ["stamp", "s", "z", "nu", "nis", "limit", "verdict", "health"]
    assert rows[3].split() == ["1795834605.010", "2.67", "0.4936", "2311", "23.93", "gated", "faulty"]
    assert "need 120 columns" in rows[4]


def test_columns_that_would_be_empty_are_left_out():
    rows = shown(answer(reading(5.01)))
    assert "fault" not in rows[2]
    assert "action" not in rows[2]
    assert "replayed" in shown(answer(reading(5.01, action="replayed")))[3]


def test_stamps_of_another_clock_show_what_delays_differ_by():
    """Recorded stamps, played now: the delay is half a century, its changes are milliseconds."""
    rows = shown(answer(reading(5.01, delay_s=1.5e9 + 0.0383), reading(5.04, delay_s=1.5e9)))
    assert "delay - least ms" in rows[2]
    assert (rows[3].split()[1], rows[4].split()[1]) == ("38.3", "0.0")


def test_a_time_that_is_not_kept_is_said_to_be_none():
    assert "12.000 s is outside of that" in shown(answer(reading(5.01), at_s=12.0))[1]
    assert shown(answer()) == ["ultrasonic: no reading has come yet"]


def watched():
    sensor = {
        "health": "faulty", "fault": FAULT, "rate_hz": 33.3, "used": 9, "rejected": 1, "late": 0, "lost": 0,
        "refused": {},
    }  # fmt: skip
    status = {
        "name": "minicar", "namespace": "fusiond/minicar", "pid": 7, "uptime_s": 3.0, "service": "degraded",
        "model": {"alarm": False},
        "estimate": {"t": 5.1, "state": {"position": 1.95}, "std": {"position": 0.002}},
        "sensors": {"ultrasonic": sensor, "applied": sensor | {"health": "healthy", "fault": None}},
    }  # fmt: skip
    return Watched(status, {"position": "m"})


def event(sensor, before, after, **other):
    return {"t": 5.04, "sensor": sensor, "from": before, "to": after, "fault": None} | other


@pytest.mark.parametrize(
    ("event", "text"),
    [
        (
            event("ultrasonic", "healthy", "faulty", fault=FAULT),
            "ultrasonic: healthy -> faulty; bias +0.4889",
        ),
        (event("ultrasonic", "faulty", "faulty", fault=FAULT), "ultrasonic: faulty; bias +0.4889"),
        (event(None, "nominal", "degraded", model=True), "degraded; the model does not describe"),
        (event(None, "nominal", "nominal", reset={"resets": 2}), "initial value, 2 resets so far"),
    ],
)
def test_an_event_reads_as_a_person_says_it(event, text):
    assert text in event_text(event)


@pytest.mark.parametrize(("columns", "lines"), [(80, 20), (140, 50)])
def test_the_panel_fits_its_terminal_and_names_the_fault(columns, lines):
    seen = watched()
    seen.events += [event("ultrasonic", "healthy", "faulty", fault=FAULT)] * 100
    out = io.StringIO()
    Console(file=out, width=columns, force_terminal=False).print(panel(seen, columns, lines))
    rows = out.getvalue().splitlines()
    assert len(rows) < lines
    assert max(map(len, rows)) <= columns
    assert any("ultrasonic" in row and "faulty: bias" in row for row in rows)


def test_a_line_says_the_same_and_that_nobody_answers():
    seen = watched()
    assert plain_line(seen) == (
        "5.10 s | degraded | +- 3 sigma | position 1.95 +-0.006 m | "
        "ultrasonic faulty: bias +0.4889 +-0.0073 m since 5.010 s | applied healthy"
    )
    seen.gone = "minicar: nothing answers"
    assert plain_line(seen) == "no answer: minicar: nothing answers"


def test_a_silence_is_not_said_twice():
    assert condition({"health": "silent", "fault": SILENT}) == "silent since 5.010 s"


def test_a_replay_says_what_was_found_and_when_it_was_over():
    faults = [
        FAULT | {"detected_s": 5.04, "cleared_s": 9.03},
        SILENT | {"detected_s": 5.2, "cleared_s": None},
    ]
    alarms = [{"detected_s": 7.0, "cleared_s": 8.0}]
    assert found_lines({"sensors": {"ultrasonic": {"faults": faults}}, "model": {"alarms": alarms}}) == [
        "  ultrasonic: bias +0.4889 +-0.0073 m since 5.010 s, found at 5.040 s, over at 9.030 s",
        "  ultrasonic: silent since 5.010 s, found at 5.200 s, to the end",
        "  model: does not describe what is measured, found at 7.000 s, over at 8.000 s",
    ]
