"""A reset is counted and says by how much the state jumped, so that whoever follows the estimate can shift with it."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.models import strapdown
from fusiond.numerics.kernel import interpreted
from fusiond.simulation.flight import flight
from fusiond.types import RESET, Action, ServiceHealth
from tests.laws.engine_rig import SECOND, one, rig, stream
from tools.pages.trials import configured, records


def reset(layout, t_ns):
    """One operator's reset, (1,)."""
    record = np.zeros(1, layout.reading)
    record["t_ns"], record["sensor"] = t_ns, RESET
    return record


@pytest.fixture(scope="module")
def flown():
    """The flight's engine after 2 s, an attitude included, and its assembly."""
    assembly = configured("flight", {"filter": {"leave_one_out": False, "local_filters": False}})
    engine = assembly.engine()
    readings, _ = flight(3, 2 * SECOND)
    engine.process(records(assembly.layout, sorted(readings, key=lambda reading: reading.t_ns)))
    return assembly, engine


def test_before_the_first_reset_there_is_no_jump():
    engine = rig()
    reports = engine.process(stream(engine.layout, 20, 1))
    assert not reports["resets"].any()
    assert not reports["jump"].any()


def test_the_jump_leads_from_the_last_estimate_to_the_initial_state():
    """At once: what is published until the next reading is the initial state, not valid; later reports repeat it."""
    engine = rig()
    readings = stream(engine.layout, 40, 2)
    last = engine.process(readings[:30])[-1].copy()
    x0 = np.zeros(2)
    report = engine.process(reset(engine.layout, int(last["t_ns"])))[0].copy()
    assert (report["action"], report["resets"], report["service"]) == (Action.RESET, 1, ServiceHealth.INVALID)
    assert np.array_equal(report["x"], x0)
    assert np.array_equal(report["jump"], x0 - last["x"])
    assert np.abs(report["jump"]).min() > 0.01
    later = engine.process(readings[30:])
    assert np.array_equal(later["jump"], np.tile(report["jump"], (10, 1)))
    assert set(later["resets"]) == {1}


def test_a_second_reset_at_once_jumps_nowhere():
    engine = rig()
    readings = stream(engine.layout, 30, 2)
    engine.process(readings)
    again = np.concatenate([reset(engine.layout, int(readings["t_ns"][-1]))] * 2)
    reports = engine.process(again)
    assert reports["resets"].tolist() == [1, 2]
    assert reports["jump"][0].any()
    assert not reports["jump"][1].any()


def test_a_reset_because_time_jumped_says_so_too():
    """A recording that starts again, without arrivals: the estimate before and the first one after, in one report."""
    engine = rig(sections="[history]\nresync_count = 5")
    before = one(engine, "c", 4000 * SECOND, [0.7])
    reports = [one(engine, "c", 400 * SECOND + k * SECOND // 10, [0.7]) for k in range(1, 20)]
    (report,) = [report for report in reports if report["action"] == Action.RESET]
    assert report["resets"] == 1
    assert np.array_equal(report["jump"], -before["x"])


def test_an_attitude_jumps_by_the_turn_between_both(flown):
    """In the slots of the error: x before [+] jump = x after."""
    assembly, engine = flown
    p = np.array(assembly.resolved.process.parameters)
    before, t_ns = engine.track[0]["x"][0].copy(), int(engine.track[0]["t_ns"])
    report = engine.process(reset(assembly.layout, t_ns))[0].copy()
    assert np.linalg.norm(report["jump"][12:]) > 0.1
    interpreted(strapdown.add_error)(before, report["jump"], p)
    after = before[:16] * np.sign(before[12] * report["x"][12]) ** (np.arange(16) >= 12)
    assert after == pytest.approx(report["x"][:16], abs=1e-12)
