"""Whose clock to believe: limits from both sides, liars among sound sensors, and jumps of the whole time base."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.types import Action, Verdict
from tests.laws.engine_rig import MS, SECOND, filters, one, reading, rig

SECTIONS = "[history]\nhorizon_s = 0.5\nmax_ahead_s = 2.0\nresync_count = 5"
LATE = {Verdict.TOO_LATE, Verdict.FROM_FUTURE}


@pytest.fixture(scope="module")
def bare():
    return rig(sections=SECTIONS)


@pytest.fixture
def engine(bare):
    bare.reset()
    return bare


def arrival(t_ns, offset_ns=77 * SECOND):
    """When a reading of that stamp comes, by the daemon's clock."""
    return t_ns + offset_ns


def test_a_stamp_ahead_is_refused_beyond_its_limit(engine):
    """max_ahead_s = 2 without arrivals: two seconds ahead of the newest is a gap, a nanosecond more a wrong clock."""
    one(engine, "c", 10 * SECOND, [0.1])
    before = engine.state_sha256()
    assert one(engine, "c", 12 * SECOND + 1, [0.1])["verdict"] == Verdict.FROM_FUTURE
    assert engine.state_sha256() == before
    assert one(engine, "c", 12 * SECOND, [0.1])["verdict"] == Verdict.USED


def test_arrivals_allow_for_the_time_that_really_passed(engine):
    """After 30 s without a reading, a stamp 32 s on is sound, a nanosecond more is not."""
    one(engine, "c", 10 * SECOND, [0.1], arrival_ns=arrival(10 * SECOND))
    came = arrival(40 * SECOND)
    late = one(engine, "c", 42 * SECOND + 1, [0.1], arrival_ns=came)
    sound = one(engine, "c", 42 * SECOND, [0.1], arrival_ns=came)
    assert (late["verdict"], sound["verdict"]) == (Verdict.FROM_FUTURE, Verdict.USED)


def run_with_a_liar(engine, lie, *, arrivals):
    """Two sound sensors at 20 Hz each, and one at 1 kHz whose stamps are lies, for 4 s; its verdicts."""
    told = []
    for k in range(4000):
        t_ns = 10 * SECOND + k * MS
        came = {"arrival_ns": arrival(t_ns)} if arrivals else {}
        if k % 50 == 0:
            assert one(engine, "c", t_ns, [0.1], **came)["verdict"] == Verdict.USED
        if k % 50 == 25:
            assert one(engine, "b", t_ns, [0.1, 0.0], **came)["verdict"] == Verdict.USED
        report = one(engine, "a", t_ns + lie(k), [50.0, -9.0], **came)
        told.append((int(report["verdict"]), int(report["action"])))
    return set(told)


LIES = {
    "an hour ahead": lambda k: 3600 * SECOND,
    "an hour behind": lambda k: -3600 * SECOND,
    "running away": lambda k: 3 * SECOND + k * 5 * MS,
    "jumping about": lambda k: (-1) ** k * (10 + k) * SECOND,
    "stuck at zero": lambda k: -(10 * SECOND + k * MS),
}


@pytest.mark.parametrize("arrivals", [True, False])
@pytest.mark.parametrize("lie", LIES)
def test_one_mad_clock_among_sound_sensors_never_moves_the_state(engine, lie, arrivals):
    """Though it sends fifty times as often as they: every reading of it is refused, the others never are."""
    told = run_with_a_liar(engine, LIES[lie], arrivals=arrivals)
    assert {verdict for verdict, _ in told} <= LATE
    assert {action for _, action in told} == {Action.NONE}
    with_liar = filters(engine)
    engine.reset()
    for k in range(0, 4000, 25):
        name, values = ("c", [0.1]) if k % 50 == 0 else ("b", [0.1, 0.0])
        one(engine, name, 10 * SECOND + k * MS, values)
    for name, values in filters(engine).items():
        assert np.array_equal(with_liar[name], values)


@pytest.mark.parametrize("jump_s", [-3600, -20, 20, 3600, 10**8])
def test_a_jump_of_the_time_base_carries_the_state_over_where_arrivals_are_known(engine, jump_s):
    """The reading that proves it comes 1.1 s after the last sound one; the state is predicted over just that time."""
    came_ns = 100 * SECOND
    one(engine, "c", 10 * SECOND, [0.7], arrival_ns=came_ns)
    x, P = engine.track[0]["x"][0].copy(), engine.covariance()
    reports = [
        one(engine, "c", (10 + jump_s) * SECOND + k * 100 * MS, [0.7], arrival_ns=came_ns + k * 100 * MS)
        for k in range(1, 14)
    ]
    actions = [report["action"] for report in reports]
    assert actions.count(Action.RETIMED) == 1
    first = actions.index(Action.RETIMED)
    assert (first + 1) * 100 * MS > SECOND
    assert {report["verdict"] for report in reports[:first]} <= LATE
    assert {report["verdict"] for report in reports[first:]} == {Verdict.USED}
    assert engine.track[0]["resets"] == 0
    # the same, had the clock been right all along
    engine.reset()
    one(engine, "c", 10 * SECOND, [0.7])
    assert np.array_equal(engine.track[0]["x"][0], x)
    assert np.array_equal(engine.covariance(), P)
    honest = one(engine, "c", 10 * SECOND + (first + 1) * 100 * MS, [0.7])
    assert reports[first]["x"] == pytest.approx(honest["x"], rel=1e-12)
    assert reports[first]["std"] == pytest.approx(honest["std"], rel=1e-12)


def after_a_jump(engine, jump_s):
    """Reports of readings at 10 Hz after a jump of the stamps, arrivals unknown."""
    one(engine, "c", 4000 * SECOND, [0.7])
    return [one(engine, "c", (4000 + jump_s) * SECOND + k * 100 * MS, [0.7]) for k in range(1, 20)]


def test_a_recording_that_starts_again_starts_the_state_again(engine):
    """Backwards without arrivals: after a second of agreeing stamps the state is set to its initial value, counted."""
    reports = after_a_jump(engine, -3600)
    actions = [report["action"] for report in reports]
    first = actions.index(Action.RESET)
    assert actions.count(Action.RESET) == 1
    assert engine.track[0]["resets"] == 1
    again = rig(sections=SECTIONS)
    fresh = one(again, "c", int(reports[first]["t_ns"]), [0.7])
    assert np.array_equal(reports[first]["x"], fresh["x"])
    assert np.array_equal(reports[first]["std"], fresh["std"])


def test_a_gap_in_a_recording_is_predicted_over(engine):
    """Forwards without arrivals, by less than an hour: time has passed."""
    reports = after_a_jump(engine, 1000)
    assert reports[-1]["verdict"] == Verdict.USED
    assert {report["action"] for report in reports} == {Action.NONE}
    assert engine.track[0]["resets"] == 0
    assert reports[-1]["t_ns"] == engine.track[0]["t_ns"]


def test_a_gap_of_more_than_an_hour_is_a_new_recording(engine):
    reports = after_a_jump(engine, 3700)
    assert Action.RESET in {report["action"] for report in reports}


def test_fewer_odd_readings_than_configured_prove_nothing(engine):
    """resync_count = 5: four agreeing ones, however long they take, are refused; the fifth is believed."""
    one(engine, "c", 4000 * SECOND, [0.7])
    verdicts = [one(engine, "c", 100 * SECOND + k * 450 * MS, [0.7])["verdict"] for k in range(6)]
    assert verdicts == [Verdict.TOO_LATE] * 4 + [Verdict.USED] * 2


def test_odd_readings_that_disagree_prove_nothing(engine):
    one(engine, "c", 4000 * SECOND, [0.7])
    stamps = [(100 + 10 * k) * SECOND for k in range(50)]
    assert {one(engine, "c", t_ns, [0.7])["verdict"] for t_ns in stamps} == {Verdict.TOO_LATE}


def test_a_slow_sound_sensor_is_waited_for():
    """A fix every 1.8 seconds is sound, if its rate says so: a liar at 10 Hz between two of them is not believed."""
    slow = rig(sections=SECTIONS, sensors={"c": {"rate_hz": 0.5}})
    for k in range(121):
        t_ns = 10 * SECOND + k * 100 * MS
        if k % 18 == 0:
            assert one(slow, "c", t_ns, [0.1])["verdict"] == Verdict.USED
        assert one(slow, "b", t_ns - 3600 * SECOND, [9.0, 9.0])["verdict"] == Verdict.TOO_LATE


def test_a_first_reading_with_a_wrong_stamp_is_outlived(engine):
    """A mad clock that happens to speak first: the sound ones are refused for a second, then believed."""
    came = 100 * SECOND
    one(engine, "a", 10**9 * SECOND, [50.0, 0.0], arrival_ns=came)
    verdicts = [
        one(engine, "c", 10 * SECOND + k * 50 * MS, [0.1], arrival_ns=came + k * 50 * MS)["verdict"]
        for k in range(60)
    ]
    assert verdicts[-1] == Verdict.USED
    assert verdicts.index(Verdict.USED) * 50 * MS <= 1100 * MS


def test_a_reading_from_before_a_jump_is_too_late_after_it(engine):
    after_a_jump(engine, -3600)
    assert one(engine, "b", 4000 * SECOND, [0.0, 0.0])["verdict"] == Verdict.FROM_FUTURE


def test_a_reference_with_a_wrong_stamp_does_not_lock_the_controller(engine):
    """One from the far future is outlived by the next sound one; one that is merely late changes nothing."""
    one(engine, "c", 10 * SECOND, [0.0])
    for t_ns, goal, kept in (
        (10 * SECOND, 1.0, 1.0),
        (10 * SECOND - 400 * MS, 2.0, 1.0),
        (10**9 * SECOND, 3.0, 3.0),
        (11 * SECOND, 4.0, 4.0),
    ):
        assert one(engine, "reference", t_ns, [goal])["verdict"] == Verdict.USED
        assert engine.desk[0]["reference"][0] == kept


def test_a_stamp_beyond_all_bounds_is_refused(engine):
    """The ends of a 64-bit integer are no stamps; sums of them must not come round."""
    one(engine, "c", 10 * SECOND, [0.1])
    before = filters(engine)
    for t_ns in (2**63 - 1, -(2**63), 0, -1):
        record = reading(engine.layout, "c", t_ns, [0.1])
        assert engine.process(record)["verdict"][0] in LATE
    for name, values in filters(engine).items():
        assert np.array_equal(before[name], values)
