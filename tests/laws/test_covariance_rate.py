"""A covariance that follows more rarely than its mean is the covariance that followed at every input."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from fusiond.assembly.assembly import assemble
from fusiond.config import parse
from fusiond.engine.reactions import widen
from fusiond.errors import ConfigError
from fusiond.simulation.flight import flight
from fusiond.types import TICK
from tests.laws.engine_rig import toml_of
from tests.laws.test_strapdown_scenes import CAR, car, drive
from tools.pages.trials import configured, records

SECOND = 10**9


@cache
def assembly(hz=None, leave_one_out=False):
    """The flight's, its covariances at a rate."""
    rate = {} if hz is None else {"covariance_hz": hz}
    return configured("flight", {"filter": {"leave_one_out": leave_one_out, "local_filters": False} | rate})


@cache
def flown():
    """5 s of flight, in the order of time."""
    readings, _ = flight(4, 5 * SECOND)
    return records(assembly().layout, sorted(readings, key=lambda reading: reading.t_ns))


def scaled(difference, P):
    """In the standard deviations of P."""
    std = np.sqrt(np.diagonal(P))
    return np.abs(difference / np.outer(std, std)).max()


@pytest.mark.parametrize("hz", [100.0, 30.0, 7.0, 0.5])
def test_the_covariance_is_that_of_the_full_rate(hz):
    """After every reading, also between two times at which it is brought forward, to 1e-12 of the deviations."""
    full, lagging = assembly().engine(), assembly(hz).engine()
    before = full.process(flown(), covariances=True).copy()
    after = lagging.process(flown(), covariances=True).copy()
    used = before["dof"] > 0
    assert used.sum() > 200
    assert after["std"][used] == pytest.approx(before["std"][used], rel=1e-12)
    assert after["x"] == pytest.approx(before["x"], rel=1e-9, abs=1e-9)
    for P, other in zip(full.covariances[::20], lagging.covariances[::20], strict=True):
        assert scaled(other - P, P) < 1e-12
    assert scaled(lagging.covariance() - full.covariance(), full.covariance()) < 1e-12


def test_between_its_times_only_the_reported_deviation_lags():
    """At 5 Hz an input's report has the deviations of 0.2 s before, at most; those of the velocity grow meanwhile."""
    full, lagging = assembly().engine(), assembly(5.0).engine()
    readings = flown()[flown()["sensor"] == 0]
    before, after = full.process(readings).copy(), lagging.process(readings).copy()
    assert np.array_equal(before["x"], after["x"])
    t_ns = before["t_ns"]
    due = np.flatnonzero(t_ns[1:] // 200_000_000 != t_ns[:-1] // 200_000_000) + 1
    assert after["std"][due] == pytest.approx(before["std"][due], rel=1e-12)
    between = np.setdiff1d(np.arange(due[0] + 1, len(t_ns)), due)
    last = due[np.searchsorted(due, between, side="right") - 1]
    assert np.array_equal(after["std"][between], after["std"][last])
    assert np.all(after["std"][between, 3] < before["std"][between, 3])


def test_a_tick_has_the_deviations_of_its_time():
    full, lagging = assembly().engine(), assembly(0.5).engine()
    tick = np.zeros(1, assembly().layout.reading)
    tick["sensor"], tick["t_ns"] = TICK, flown()["t_ns"][-1] + 5_000_000
    for engine in (full, lagging):
        engine.process(flown())
    expected = full.process(tick)[0].copy()
    state = lagging.state_sha256()
    assert lagging.process(tick)[0]["std"] == pytest.approx(expected["std"], rel=1e-12)
    assert lagging.state_sha256() == state


def test_late_readings_end_in_the_same_bytes():
    """What is pending is part of the track: arrivals up to 0.2 s late are rolled back and replayed to the bit."""
    rng = np.random.default_rng(6)
    readings = flown()[flown()["t_ns"] < 4_980_000_000]
    arrival = readings["t_ns"] + (rng.random(len(readings)) < 0.05) * rng.integers(
        0, SECOND // 5, len(readings)
    )
    order = np.argsort(arrival, kind="stable")
    assert not np.array_equal(order, np.arange(len(order)))
    straight, shuffled, alone = (assembly(12.0, leave_one_out=True).engine() for _ in range(3))
    straight.process(readings)
    shuffled.process(readings[order])
    for record in readings:
        alone.process(np.array([record], dtype=readings.dtype))
    assert straight.track[0]["pending"].any()
    assert straight.state_sha256() == shuffled.state_sha256() == alone.state_sha256()


def test_leaving_a_sensor_out_is_still_never_having_had_it():
    """Each filter's covariance goes by its own readings."""
    engine = assembly(12.0, leave_one_out=True).engine()
    readings = flown()
    engine.process(readings)
    layout = engine.layout
    row = next(k for k, one in enumerate(layout.filters) if one.sensor == "barometer")
    lone = assembly(12.0).engine()
    lone.process(readings[readings["sensor"] != layout.numbers["barometer"]])
    for name in ("x", "U", "d", "pending_F", "pending_Q", "pending"):
        assert np.array_equal(engine.track[0][name][row], lone.track[0][name][0]), name


def test_a_widened_covariance_is_that_of_the_full_rate():
    """WHEN g g' is added while something is pending, THEN P + g g' of the full rate, at once and later, to 1e-12."""
    full, lagging = assembly().engine(), assembly(12.0).engine()
    for engine in (full, lagging):
        engine.process(flown()[flown()["t_ns"] < 3 * SECOND])
    assert lagging.track[0]["pending"][0]
    P = full.covariance()
    g = np.random.default_rng(2).standard_normal(len(P)) * np.sqrt(np.diagonal(P))
    for engine in (full, lagging):
        widen(engine, 0, np.outer(g, g))
        assert scaled(engine.covariance() - (P + np.outer(g, g)), P) < 1e-12
    for engine in (full, lagging):
        engine.process(flown()[flown()["t_ns"] >= 3 * SECOND])
    assert scaled(lagging.covariance() - full.covariance(), full.covariance()) < 1e-12


def test_a_linear_model_has_one_rate():
    text = toml_of(sections="[filter]\ncovariance_hz = 10.0")
    with pytest.raises(ConfigError, match=r"filter\.covariance_hz: only of nonlinear models"):
        assemble(parse(text, "test"))


def test_a_drive_without_sky_ends_where_it_did():
    """Wheels and zero velocities at 20 and 100 Hz, an IMU at 100 Hz, the covariance at 10 Hz."""
    readings, _ = drive()
    batch = sorted(readings, key=lambda reading: reading.t_ns)
    lagging = assemble(parse(CAR.replace("[filter]\n", "[filter]\ncovariance_hz = 10.0\n"), "car"))
    x = lagging.engine().process(records(lagging.layout, batch))["x"][-1].copy()
    expected = car().engine().process(records(car().layout, batch))["x"][-1].copy()
    assert x == pytest.approx(expected, rel=1e-8, abs=1e-8)
