"""The bank's local filters, resets as events, and sensors whose stamps come late."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.engine.layout import FilterLayout
from fusiond.types import RESET, Action, ServiceHealth, Verdict
from tests.laws.engine_rig import MS, SECOND, filters, reading, rig, stream


def reset_event(layout, t_ns):
    record = np.zeros(1, layout.reading)
    record["t_ns"], record["sensor"] = t_ns, RESET
    return record


@pytest.mark.parametrize("alone", ["a", "b", "c"])
def test_a_local_filter_is_a_run_that_heard_one_sensor_only(alone):
    """Bit for bit, against the centralized filter of a run that was given only that sensor and the input."""
    whole, lone = rig(), rig()
    readings = stream(whole.layout, 300, 12)
    heard = np.isin(readings["sensor"], [whole.layout.numbers[alone], whole.layout.numbers["drive"]])
    whole.process(readings)
    start = readings[:1] if heard[0] else None
    assert start is not None or readings["t_ns"][0] <= readings["t_ns"][heard][0]
    lone.process(readings[heard])
    row = whole.layout.filters.index(FilterLayout("only", alone))
    kept, other = filters(whole), filters(lone)
    if readings["t_ns"][0] == readings["t_ns"][heard][0]:
        assert np.array_equal(kept["x"][row], other["x"][0])
        assert np.array_equal(kept["d"][row], other["d"][0])
    assert kept["x"][row] == pytest.approx(other["x"][0], abs=1e-6)
    assert not np.array_equal(kept["x"][row], kept["x"][0])


def test_a_sensor_that_sees_too_little_bears_no_filter():
    """Whoever cannot see every state alone has no row; with one sensor there is nothing to compare."""
    names = {(row.hears, row.sensor) for row in rig().layout.filters}
    assert ("only", "c") in names
    blind = rig(sensors={"c": {"H": [[0.0, 1.0]]}}, model={"A": [[0.0, 1.0], [0.0, 0.0]]}).layout.filters
    assert FilterLayout("only", "a") in blind
    assert FilterLayout("only", "c") not in blind


def test_a_reset_is_an_event_that_a_replay_meets_at_the_same_place():
    """The state starts anew with the next reading; what an input holds, it goes on holding."""
    engine, again = rig(), rig()
    layout = engine.layout
    readings = stream(layout, 120, 13)
    last_ns = int(readings["t_ns"][59])
    log = np.concatenate([readings[:60], reset_event(layout, last_ns), readings[60:]])
    reports = engine.process(log).copy()
    assert reports[60]["action"] == Action.RESET
    assert reports[60]["service"] == ServiceHealth.INVALID
    assert reports[61]["verdict"] == Verdict.USED
    assert engine.track[0]["resets"] == 1
    before, fresh = rig(), rig()
    before.process(readings[:60])
    fresh.track["u"], fresh.track["u_var"] = before.track["u"], before.track["u_var"]
    fresh.process(readings[60:])
    assert np.array_equal(filters(fresh)["x"], filters(engine)["x"])
    for record in log:
        again.process(np.array([record], dtype=layout.reading))
    assert again.state_sha256() == engine.state_sha256()


def test_a_delayed_stamp_is_put_back_to_its_measurement():
    """delay_s = 0.02 with stamps 0.02 s late is no delay with true stamps, to the last bit of the filters."""
    late, true = rig(sensors={"b": {"delay_s": 0.02}}), rig()
    readings = stream(true.layout, 200, 14)
    true.process(readings)
    shifted = readings.copy()
    shifted["t_ns"][shifted["sensor"] == true.layout.numbers["b"]] += 20 * MS
    reports = late.process(shifted)
    assert np.array_equal(reports["t_ns"], shifted["t_ns"])
    for name, value in filters(true).items():
        assert np.array_equal(filters(late)[name], value), name


def test_an_undelayed_sensor_keeps_its_stamp():
    engine = rig(sensors={"b": {"delay_s": 0.02}})
    engine.process(reading(engine.layout, "a", SECOND, [0.0, 0.0]))
    assert engine.track[0]["filter_t_ns"][0] == SECOND
    engine.process(reading(engine.layout, "b", SECOND + 50 * MS, [0.0, 0.0]))
    assert engine.track[0]["filter_t_ns"][0] == SECOND + 30 * MS
