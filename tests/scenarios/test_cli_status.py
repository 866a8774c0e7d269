"""`fusiond status` on a terminal: what is as it should be in tables, what is not in a line of its own."""

from __future__ import annotations

from typing import Any

import pytest
from rich.console import Console

from fusiond.cli import status_view
from fusiond.cli.status_view import show_status

HEALTHY = {
    "health": "healthy", "heard": True, "fault": None, "rate_hz": 33.3, "used": 7, "rejected": 0, "late": 0, "lost": 0,
    "verdicts": {"used": 7}, "refused": {},
}  # fmt: skip
BIAS = {
    "kind": "bias", "channel": None, "onset_s": 10.0, "size": 0.5, "size_std": 0.01, "unit": "m", "ambiguous_with": [],
}  # fmt: skip
ANSWER: dict[str, Any] = {
    "version": "1", "name": "minicar", "namespace": "fusiond/minicar", "pid": 42, "mode": "peer",
    "endpoints": ["tcp/127.0.0.1:7447"], "epoch": 1, "uptime_s": 12.3, "service": "nominal", "model": {"alarm": False},
    "resets": 0, "readings": 1234, "ticks": 0, "sensors": {"ultrasonic": HEALTHY}, "refused": {},
    "queue": {"waiting": 0, "capacity": 8192, "dropped": 0},
    "estimate": {"t": 3.0, "state": {"position": 1.5}, "std": {"position": 0.25}}, "parity": {}, "repairs": 0,
    "guard": {}, "state_sha256": "", "recording": None,
}  # fmt: skip


def printed(capsys, **changes) -> str:
    show_status(ANSWER | changes)
    return capsys.readouterr().out


def test_what_is_well_takes_no_more_than_its_tables(capsys):
    said = printed(capsys)
    for part in (
        "minicar: nominal, up 12 s, 1,234 readings",
        "position",
        "1.5",
        "0.25",
        "ultrasonic",
        "33.3",
    ):
        assert part in said
    assert said.rstrip().splitlines()[-1].startswith("ultrasonic")


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"model": {"alarm": True}}, "model alarm"),
        ({"resets": 2}, "resets: 2"),
        (
            {"repairs": 3, "guard": {"largest": 0.5, "last": 0.25}},
            "repaired 3 times, the largest change 0.5, the last",
        ),
        ({"refused": {"bad_crc": 4}}, "no readings: bad_crc 4"),
        ({"queue": {"waiting": 1, "capacity": 8, "dropped": 5}}, "queue: 5 puts dropped, 1 of 8 waiting"),
        ({"recording": {"error": "", "dropped": {}}}, "recording: running, dropped none"),
        (
            {"recording": {"error": "disk full", "dropped": {"reports": 2}}},
            "recording: disk full, dropped reports 2",
        ),
        ({"estimate": None}, "ultrasonic"),
    ],
)
def test_what_is_not_has_its_line(capsys, changes, line):
    assert line in " ".join(printed(capsys, **changes).split())


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({}, ["healthy"]),
        ({"heard": False, "health": "silent"}, ["never heard"]),
        ({"heard": False, "health": "healthy"}, ["never heard"]),
        (
            {"health": "excluded", "fault": BIAS},
            ["excluded", "ultrasonic: bias +0.5 +-0.01 m since 10.000 s"],
        ),
        (
            {"health": "silent", "fault": BIAS | {"kind": "silent"}},
            ["silent", "ultrasonic: silent since 10.000 s"],
        ),
    ],
)
def test_a_sensor_says_what_is_wrong_with_it(capsys, changes, words):
    """Its health at the end of its row, its fault in a line of its own."""
    row, *faults = printed(capsys, sensors={"ultrasonic": HEALTHY | changes}).rstrip().splitlines()[5:]
    assert row.startswith("ultrasonic")
    assert [row.split("  ")[-1].strip(), *faults] == words


def test_80_columns_hold_every_sensor_in_a_row(capsys, monkeypatch):
    """A name of 16 letters, eight-digit counts and a fault of two: no row is broken."""
    monkeypatch.setattr(status_view, "console", Console(width=80, soft_wrap=True))
    busy = HEALTHY | {
        "used": 12_345_678,
        "rejected": 1234,
        "health": "excluded",
        "fault": BIAS,
        "rate_hz": 1000.0,
    }
    rows = printed(capsys, sensors=dict.fromkeys(["accelerometer_xy", "gps"], busy)).splitlines()
    assert [row.split()[-1] for row in rows if row.startswith(("accelerometer_xy ", "gps "))] == [
        "excluded"
    ] * 2
    assert max(map(len, rows)) <= 80
