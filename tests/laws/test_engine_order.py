"""Arrival order changes no bit: late readings inside the horizon end where ordered ones do."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusiond.types import Action, Verdict
from tests.laws.engine_rig import MS, SECOND, one, reading, rig, stream, tick

SEEDS = st.integers(0, 10**9)
HOLDS = ("next", "previous")


def engine_of(hold="next", **more):
    return rig(sensors={"drive": {"hold": f'"{hold}"'}}, **more)


def ended(engine, readings):
    """Hash of the track after these readings, and how many were used."""
    engine.reset()
    verdicts = engine.process(readings)["verdict"]
    return engine.state_sha256(), int((verdicts == Verdict.USED).sum())


@pytest.mark.parametrize("hold", HOLDS)
@given(seed=SEEDS, data=st.data())
@settings(max_examples=25)
def test_any_order_inside_the_horizon_ends_in_the_same_bits(hold, seed, data):
    """Four sensors, equal stamps, an input; every order of arrival whose delays the horizon covers."""
    engine = engine_of(hold)
    readings = stream(engine.layout, 24, seed)
    assert np.ptp(readings["t_ns"]) < SECOND
    ordered = ended(engine, readings)
    order = data.draw(st.permutations(range(len(readings))))
    assert ended(engine, readings[list(order)]) == ordered


@given(seed=SEEDS)
@settings(max_examples=15)
def test_delays_and_duplicates_in_a_long_stream_change_nothing(seed):
    """Six hundred readings over 3 s, each up to 0.9 s late, a third of them twice."""
    engine = engine_of()
    rng = np.random.default_rng(seed)
    readings = stream(engine.layout, 600, seed)
    ordered = ended(engine, readings)
    twice = np.concatenate([readings, readings[rng.integers(0, 600, 200)]])
    arrivals = twice["t_ns"] + rng.integers(0, 900 * MS, len(twice))
    state, used = ended(engine, twice[np.argsort(arrivals, kind="stable")])
    assert (state, used) == ordered


def test_batches_of_any_size_give_the_same_bits():
    """Track, desk and every report."""
    engine = engine_of()
    readings = stream(engine.layout, 200, 5)[np.random.default_rng(1).permutation(200)]
    whole = engine.process(readings).copy()
    bytes_of = engine.track.tobytes(), engine.desk.tobytes()
    for size in (1, 3, 64):
        engine.reset()
        parts = [engine.process(readings[k : k + size]).copy() for k in range(0, 200, size)]
        assert np.concatenate(parts).tobytes() == whole.tobytes()
        assert (engine.track.tobytes(), engine.desk.tobytes()) == bytes_of


def test_the_same_readings_twice_are_the_same_run():
    engine = engine_of()
    readings = stream(engine.layout, 300, 8)
    first = engine.process(readings).tobytes()
    engine.reset()
    assert engine.process(readings).tobytes() == first


def test_the_horizon_is_kept_to_the_nanosecond():
    """A reading exactly one horizon old is put in its place; one nanosecond older is too_late and changes nothing."""
    engine = engine_of(sections="[history]\nhorizon_s = 0.5")
    early, late = (reading(engine.layout, "a", 9 * SECOND + 500 * MS - k, [1.0, 2.0]) for k in (0, 1))
    newest = reading(engine.layout, "c", 10 * SECOND, [0.5])
    engine.process(newest)
    before = engine.state_sha256()
    refused = engine.process(late)[0].copy()
    assert refused["verdict"] == Verdict.TOO_LATE
    assert refused["action"] == Action.NONE
    assert engine.state_sha256() == before
    taken = engine.process(early)[0].copy()
    assert taken["verdict"] == Verdict.USED
    assert taken["action"] == Action.REPLAYED
    state = engine.state_sha256()
    assert ended(engine, np.concatenate([early, newest]))[0] == state


def test_the_report_of_a_late_reading_tells_its_own_innovation_and_the_newest_state():
    engine = engine_of()
    readings = stream(engine.layout, 30, 2, distinct=True)
    of_a = np.flatnonzero(readings["sensor"] == engine.layout.numbers["a"])[1]
    in_order = engine.process(readings).copy()
    engine.reset()
    engine.process(np.delete(readings, of_a))
    late = engine.process(readings[of_a : of_a + 1])[0].copy()
    for name in ("nu", "S", "e", "nis", "dof", "R_used"):
        assert np.array_equal(late[name], in_order[of_a][name])
    assert np.array_equal(late["x"], in_order[-1]["x"])
    assert late["state_t_ns"] == in_order[-1]["state_t_ns"]


def test_the_history_grows_where_the_horizon_holds_more_than_it_has_room_for():
    """Six thousand readings within one horizon, the oldest arriving last."""
    engine = engine_of()
    readings = stream(engine.layout, 6000, 3, step_ns=100_000)
    assert np.ptp(readings["t_ns"]) < SECOND
    room = len(engine._ring)
    ordered = ended(engine, readings)
    late = np.concatenate([readings[5:], readings[:5]])
    assert ended(engine, late) == ordered
    assert len(engine._ring) > room


def test_a_long_ordered_run_needs_no_more_room():
    engine = engine_of()
    room = len(engine._ring)
    readings = stream(engine.layout, 10_000, 3)
    engine.process(readings)
    assert len(engine._ring) == room


@pytest.mark.parametrize("late", [False, True])
def test_a_duplicate_is_the_same_stamp_and_numbers_where_there_is_no_sequence(late):
    """Also when it comes late; an equal value at another stamp is none."""
    engine = engine_of()
    readings = stream(engine.layout, 20, 6, distinct=True)
    engine.process(readings)
    before = engine.state_sha256()
    again = readings[3:4] if late else readings[-1:]
    assert engine.process(again)["verdict"][0] == Verdict.DUPLICATE
    assert engine.state_sha256() == before
    again = again.copy()
    again["t_ns"] += 1
    assert engine.process(again)["verdict"][0] == Verdict.USED


def test_ticks_change_no_bit_of_the_track():
    """Before the first reading, between readings, behind and far ahead of them."""
    engine = engine_of()
    readings = stream(engine.layout, 60, 9)
    state = ended(engine, readings)[0]
    engine.reset()
    engine.process(tick(engine.layout, 5))
    for record in readings:
        engine.process(record[None])
        for ahead_ns in (-SECOND, 7 * MS, 90 * SECOND):
            before = engine.track.tobytes()
            engine.process(tick(engine.layout, int(record["t_ns"]) + ahead_ns))
            assert engine.track.tobytes() == before
    assert engine.state_sha256() == state


def test_a_tick_tells_the_state_of_its_own_time():
    """x at the tick is what the next reading would be predicted from."""
    engine = engine_of()
    engine.process(stream(engine.layout, 40, 4))
    now_ns = int(engine.track[0]["t_ns"]) + 300 * MS
    told = engine.process(tick(engine.layout, now_ns))[0].copy()
    after = one(engine, "c", now_ns, [0.3])
    assert told["state_t_ns"] == now_ns
    assert told["verdict"] == Verdict.USED
    assert after["nu"][0] == pytest.approx(0.3 - told["x"][0], abs=1e-12)
    assert after["S"][0] == pytest.approx(told["std"][0] ** 2 + 0.1**2, rel=1e-12)


def test_a_reset_forgets_everything():
    engine = engine_of()
    fresh = engine.track.tobytes(), engine.desk.tobytes()
    engine.process(stream(engine.layout, 50, 1))
    assert engine.track.tobytes() != fresh[0]
    engine.reset()
    assert (engine.track.tobytes(), engine.desk.tobytes()) == fresh
