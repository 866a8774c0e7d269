"""Errors taken off readings: one upon another, on trial, and given up; and a gate that stays shut."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fusiond.assembly.assembly import Assembly, assemble
from fusiond.config import parse
from fusiond.engine.correction import Attempt, put_on
from fusiond.engine.engine import Engine
from fusiond.simulation.tables import Reading
from fusiond.types import NANOSECONDS, Kind, Verdict
from tools.pages.trials import records

STRAIGHT = """
name = "straight"

[model]
kind = "planar_constant_velocity"
acceleration_noise_m_s2 = {density}

[initial]
state = {{ x_m = 20.0, y_m = 0.0, vx_m_s = 0.0, vy_m_s = 5.0 }}
std = {{ x_m = 1.0, y_m = 1.0, vx_m_s = 1.0, vy_m_s = 1.0 }}

[sensor.fix]
kind = "direct"
slots = ["x", "y"]
rate_hz = 10.0
noise_std = {{ x_m = 1.0, y_m = 1.0 }}

[sensor.doppler]
kind = "direct"
slots = ["vx", "vy"]
rate_hz = 10.0
noise_std = {{ vx_m_s = 0.2, vy_m_s = 0.2 }}

[faults]
"""
"""A filter that believes in straight lines; without its fixes nothing observes the position."""
RADIUS_M, SPEED_M_S = 20.0, 5.0


class Nobody:
    """A judge that lets everything pass."""

    def consider(self, engine: Engine) -> None:
        """Do nothing."""


@functools.cache
def straight(density: float) -> Assembly:
    """The filter, with a process noise of so many m/s2 per root hertz."""
    return assemble(parse(STRAIGHT.format(density=density), "straight"))


def circle(
    layout: Any, seconds: float, seed: int, off_m: float = 0.0
) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Readings on a circle, fixes off by `off_m` in x in the second half; and (k, 2) the true positions, m."""
    rng = np.random.default_rng(seed)
    readings: list[Reading] = []
    where = []
    for k in range(int(10 * seconds)):
        angle = SPEED_M_S / RADIUS_M * 0.1 * k
        away, along = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        fix = RADIUS_M * away + rng.normal(0.0, 1.0, 2) + [off_m if k >= 5 * seconds else 0.0, 0.0]
        readings.append(Reading(k * NANOSECONDS // 10, "fix", tuple(fix.tolist())))
        doppler = SPEED_M_S * along + rng.normal(0.0, 0.2, 2)
        readings.append(Reading(k * NANOSECONDS // 10, "doppler", tuple(doppler.tolist())))
        where += [RADIUS_M * away] * 2
    return records(layout, readings), np.array(where)


def corrected(z: float, t_s: float, taken: dict[str, Any]) -> float:
    """A reading of channel 0 with what is known of its error taken off, as in step/decided.py."""
    return float((z - taken["offset"][0] - taken["drift"][0] * t_s) / (1.0 + taken["gain_error"][0]))


@pytest.mark.parametrize("seed", range(5))
def test_a_second_error_is_taken_off_what_is_left_of_the_first(seed):
    """Six errors of any kind put on one another: the same number as each taken off the result of those before."""
    rng = np.random.default_rng(seed)
    taken = {field: np.zeros(2) for field in ("offset", "drift", "gain_error", "lag")}
    z, t_s = 3.0, 0.7
    one_by_one = z
    for kind in rng.choice([Kind.BIAS, Kind.DRIFT, Kind.SCALE], 6):
        size = float(rng.uniform(-0.9, 2.0))
        put_on(taken, Kind(int(kind)), 0, size)
        if kind == Kind.SCALE:
            one_by_one /= 1.0 + size
        else:
            one_by_one -= size * (t_s if kind == Kind.DRIFT else 1.0)
        assert corrected(z, t_s, taken) == pytest.approx(one_by_one, rel=1e-12)
    assert not taken["lag"].any()


def off_by(taken_m: float) -> tuple[Engine, Attempt]:
    """12 s on the circle, fixes 3 m off from 6 s on; from there `taken_m` is taken off them, and replayed."""
    assembly = straight(2.0)
    engine = assembly.engine()
    engine._judge = Nobody()  # type: ignore[assignment]
    engine.process(circle(assembly.layout, 12.0, 0, off_m=3.0)[0])
    fix = assembly.layout.numbers["fix"]
    attempt = Attempt(engine, (fix,), 6 * NANOSECONDS)
    for track in engine.histories:
        track["reaction"]["offset"][:, fix, 1, 0] = taken_m
        track["reaction"]["from_ns"][:, fix, 1] = 6 * NANOSECONDS
    engine.replay_since(6 * NANOSECONDS)
    return engine, attempt


def test_a_correction_that_fits_is_kept_and_one_that_does_not_leaves_no_trace():
    """3 m off: taking 3 m off makes the innovations smaller, -3 m larger; withdrawn, the track is what it was."""
    before, _ = off_by(0.0)
    right, kept = off_by(3.0)
    assert kept.helped
    assert right.state_sha256() != before.state_sha256()

    wrong, attempt = off_by(-3.0)
    assert not attempt.helped
    attempt.withdraw()
    assert np.array_equal(wrong.track["x"], before.track["x"])
    assert not wrong.track["reaction"]["offset"].any()


@pytest.mark.parametrize("seed", range(2))
def test_a_model_that_is_wrong_cannot_lead_the_estimate_away_from_its_only_fixes(seed):
    """GIVEN straight lines to 0.01 m/s2 and a circle of 1.25 m/s2, THEN it never goes on straight for over a minute.

    Corrections that nothing limits led it 1e151 m away; the bounds are those of a filter that sometimes goes astray
    and always comes back, not of a good one.
    """
    assembly = straight(0.01)
    readings, where = circle(assembly.layout, 120.0, seed)
    engine = assembly.engine()
    reports = engine.process(readings).copy()
    away_m = np.linalg.norm(reports["x"][:, :2] - where, axis=1)
    assert np.all(np.isfinite(reports["x"]))
    assert np.max(away_m) < 60.0 * SPEED_M_S + 2.0 * RADIUS_M
    assert np.min(away_m[len(away_m) // 2 :]) < RADIUS_M
    assert reports["model"].any()


def test_the_same_fixes_with_an_honest_model_are_nobody_s_fault():
    """GIVEN 2 m/s2 per root hertz, THEN nobody is named, and the estimate is within 3 m."""
    assembly = straight(2.0)
    readings, where = circle(assembly.layout, 60.0, 3)
    reports = assembly.engine().process(readings).copy()
    assert not reports["health"].any()
    assert np.max(np.linalg.norm(reports["x"][:, :2] - where, axis=1)[20:]) < 3.0


def test_a_gate_that_refuses_64_readings_in_a_row_opens():
    """GIVEN nobody judges, WHEN all fixes jump by 300 m, THEN 64 to 68 are gated and the estimate follows then."""
    assembly = straight(2.0)
    engine = assembly.engine()
    engine._judge = Nobody()  # type: ignore[assignment]
    readings, where = circle(assembly.layout, 60.0, 0, off_m=300.0)
    reports = engine.process(readings).copy()
    fixes = reports[reports["sensor"] == assembly.layout.numbers["fix"]]
    late = fixes[300:]
    assert np.all(late["verdict"][:64] == Verdict.GATED)
    assert Verdict.USED in late["verdict"][64:69]
    assert np.mean(late["verdict"][68:] == Verdict.USED) > 0.9
    assert abs(reports["x"][-1, 0] - where[-1, 0] - 300.0) < 5.0
