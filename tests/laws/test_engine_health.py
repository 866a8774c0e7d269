"""What the age of data does: silence, dead reckoning, invalidity; and commands on their grid."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fusiond.types import Health, ServiceHealth, Verdict
from tests.laws.engine_rig import MS, SECOND, one, rig, stream, tick

SECTIONS = "[health]\ndead_reckoning_s = 1.0\ninvalid_s = 5.0"
RATES = {"a": {"rate_hz": 10.0}, "b": {"max_silence_s": 0.7}}


@pytest.fixture
def engine():
    return rig(sections=SECTIONS, sensors=RATES)


def at(engine, t_ns):
    """Report of a tick."""
    return engine.process(tick(engine.layout, t_ns))[0].copy()


def test_before_the_first_reading_the_estimate_is_invalid(engine):
    assert at(engine, SECOND)["service"] == ServiceHealth.INVALID
    refused = one(engine, "c", SECOND, [math.nan])
    assert refused["verdict"] == Verdict.NON_FINITE
    assert refused["service"] == ServiceHealth.INVALID


@pytest.mark.parametrize(("name", "limit_ns"), [("a", 300 * MS), ("b", 700 * MS)])
def test_a_sensor_is_silent_beyond_its_limit(engine, name, limit_ns):
    """Three periods of its rate, or what was said; at the limit it is healthy."""
    number = engine.layout.numbers[name]
    one(engine, name, SECOND, [0.0, 0.0])
    assert at(engine, SECOND + limit_ns)["health"][number] == Health.HEALTHY
    assert at(engine, SECOND + limit_ns + 1)["health"][number] == Health.SILENT


def test_a_sensor_never_heard_is_silent_after_its_limit(engine):
    one(engine, "c", SECOND, [0.0])
    told = at(engine, SECOND + 701 * MS)
    assert [told["health"][engine.layout.numbers[name]] for name in "abc"] == [
        Health.SILENT,
        Health.SILENT,
        Health.HEALTHY,
    ]


def test_a_sensor_without_a_rate_is_never_silent(engine):
    one(engine, "c", SECOND, [0.0])
    assert at(engine, 100 * SECOND)["health"][engine.layout.numbers["c"]] == Health.HEALTHY


def test_a_refused_reading_is_no_sign_of_life(engine):
    one(engine, "b", SECOND, [0.0, 0.0])
    for k in range(1, 9):
        one(engine, "c", SECOND + k * 100 * MS, [0.0])
        one(engine, "b", SECOND + k * 100 * MS, [math.nan, 0.0])
    told = at(engine, SECOND + 800 * MS)
    assert told["health"][engine.layout.numbers["b"]] == Health.SILENT


@pytest.mark.parametrize(
    ("age_ns", "health"),
    [
        (0, ServiceHealth.NOMINAL),
        (300 * MS, ServiceHealth.NOMINAL),
        (300 * MS + 1, ServiceHealth.DEGRADED),
        (SECOND, ServiceHealth.DEGRADED),
        (SECOND + 1, ServiceHealth.DEAD_RECKONING),
        (5 * SECOND, ServiceHealth.DEAD_RECKONING),
        (5 * SECOND + 1, ServiceHealth.INVALID),
    ],
)
def test_the_service_falls_by_the_age_of_the_last_correction(engine, age_ns, health):
    """An input goes on all the time and helps nothing: only a correction makes it nominal again."""
    one(engine, "a", SECOND, [0.0, 0.0])
    for k in range(1, age_ns // (200 * MS)):
        one(engine, "drive", SECOND + k * 200 * MS, [0.0])
    assert at(engine, SECOND + age_ns)["service"] == health
    one(engine, "b", SECOND + age_ns, [0.0, 0.0])
    assert one(engine, "a", SECOND + age_ns, [0.0, 0.0])["service"] == ServiceHealth.NOMINAL


def test_a_state_that_is_not_finite_is_invalid():
    """An unstable model left alone until it overflows says so, and neither raises nor commands."""
    engine = rig(
        model={"A": [[40.0, 0.0], [0.0, 40.0]]},
        sections="[health]\ninvalid_s = 1000.0\ndead_reckoning_s = 999.0",
    )
    one(engine, "a", SECOND, [1.0, 1.0])
    one(engine, "reference", SECOND, [1.0])
    told = at(engine, 40 * SECOND)
    assert not np.isfinite(told["x"]).all()
    assert told["service"] == ServiceHealth.INVALID
    assert told["command_due"] == 1
    assert told["command_valid"] == 0
    assert np.isfinite(told["command"]).all()


def test_commands_lie_on_a_regular_grid(engine):
    """10 Hz of data time from the first reading, whatever the readings do; a gap is skipped, not made up for."""
    one(engine, "reference", SECOND, [2.0])
    due = []
    for t_ms in [1000, 1003, 1099, 1100, 1101, 1250, 1299, 1300, 2345, 2346, 2399, 2400]:
        report = at(engine, t_ms * MS) if t_ms % 2 else one(engine, "c", t_ms * MS, [0.0])
        if report["command_due"]:
            due.append(t_ms)
    assert due == [1000, 1100, 1250, 1300, 2345, 2400]


def test_the_command_is_the_law_of_the_reported_state(engine):
    """u = clip(2 (goal - position) - velocity, -3, 3)."""
    one(engine, "reference", SECOND, [0.8])
    for record in stream(engine.layout, 80, 3, step_ns=60 * MS):
        report = engine.process(record[None])[0]
        if report["command_due"]:
            wanted = 2.0 * (0.8 - report["x"][0]) - report["x"][1]
            assert report["command_valid"] == 1
            assert report["command"][0] == pytest.approx(min(max(wanted, -3.0), 3.0), abs=1e-12)


def test_without_a_reference_no_command_is_valid(engine):
    report = one(engine, "c", SECOND, [0.0])
    assert (report["command_due"], report["command_valid"]) == (1, 0)
    assert one(engine, "reference", SECOND, [2.0])["verdict"] == Verdict.USED
    report = one(engine, "c", SECOND + 100 * MS, [0.0])
    assert (report["command_due"], report["command_valid"]) == (1, 1)


def test_a_configured_reference_holds_from_the_start():
    engine = rig(sections="reference = { position = 2.0 }")
    report = one(engine, "c", SECOND, [0.0])
    assert report["command_valid"] == 1
    assert report["command"][0] > 0.0


def test_an_invalid_estimate_commands_nothing(engine):
    one(engine, "reference", SECOND, [2.0])
    one(engine, "c", SECOND, [0.0])
    reckoning, invalid = at(engine, 6 * SECOND), at(engine, 6 * SECOND + 100 * MS)
    assert (reckoning["service"], reckoning["command_valid"]) == (ServiceHealth.DEAD_RECKONING, 1)
    assert (invalid["service"], invalid["command_due"], invalid["command_valid"]) == (
        ServiceHealth.INVALID,
        1,
        0,
    )


def test_an_acknowledgement_is_kept_and_drives_nothing(engine):
    one(engine, "c", SECOND, [0.0])
    before = engine.track.tobytes()
    assert one(engine, "applied", SECOND + MS, [1.5])["verdict"] == Verdict.USED
    assert engine.track.tobytes() == before
    assert engine.desk[0]["applied"][0] == 1.5
