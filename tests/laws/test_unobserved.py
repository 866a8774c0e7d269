"""What cannot be observed is not learned: the laws of the guard, and of velocities that turn with the heading."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from fusiond.assembly.assembly import assemble
from fusiond.assembly.trial import Trial
from fusiond.config import Config, parse
from fusiond.errors import ConfigError
from fusiond.filters.innovation import Innovation
from fusiond.filters.joseph import update
from fusiond.numerics.kernel import interpreted
from fusiond.numerics.ud import ud_add, ud_compose, ud_covariance
from fusiond.simulation.flight import flight
from fusiond.simulation.tables import Reading
from fusiond.types import Verdict
from tests.laws.engine_rig import rig, toml_of
from tests.laws.test_strapdown_scenes import car, drive
from tests.scenarios.test_observability_guard import standing, still
from tools.pages.trials import configured, records

SECOND = 10**9
HEADING, GYRO_X, GYRO_Z = 14, 6, 8
"""Places in the error of the strapdown model."""


def factors(rng, n):
    """U, d of a random covariance, one of whose variances is zero."""
    U = np.triu(rng.standard_normal((n, n)), 1) + np.eye(n)
    return U, np.append(rng.uniform(0.1, 3.0, n - 1), 0.0)[rng.permutation(n)]


def composed(U, d):
    P = np.zeros(U.shape)
    interpreted(ud_compose)(U, d, P)
    return P


@pytest.mark.parametrize("seed", range(20))
def test_a_rank_one_term_is_added(seed):
    """U diag(d) U' + c a a', whatever is singular; elements are those of the product."""
    rng = np.random.default_rng(seed)
    n = 6
    U, d = factors(rng, n)
    P = composed(U, d)
    a, c = rng.standard_normal(n) * (rng.random(n) < 0.6), float(rng.uniform(0.0, 2.0))
    assert [[interpreted(ud_covariance)(U, d, i, j) for j in range(n)] for i in range(n)] == pytest.approx(P)
    interpreted(ud_add)(U, d, a.copy(), c)
    assert composed(U, d) == pytest.approx(P + c * np.outer(a, a), rel=1e-12, abs=1e-12)
    assert np.all(d >= 0.0)


def before_and_after(assembly, readings):
    """Estimates x, P of the centralized filter before and after the last reading, which comes with the one before."""
    engine = assembly.engine()
    engine.process(readings[:-1])
    x, P = engine.track[0]["x"][0].copy(), engine.covariance()
    report = engine.process(readings[-1:])[0].copy()
    return x, P, engine.track[0]["x"][0].copy(), engine.covariance(), report


def seen_by(assembly, name, x, report):
    """What a sensor's reading says, as every update of the house takes it."""
    (sensor,) = [sensor for sensor in assembly.resolved.sensors if sensor.name == name]
    h, H = Trial(assembly.resolved).look(sensor, x)
    return Innovation(report["z"][: len(h)] - h, H, sensor.R)


@cache
def aloft():
    """The flight's assembly with one filter."""
    return configured("flight", {"filter": {"leave_one_out": False, "local_filters": False}})


def until(name, start_s):
    """The flight's readings up to the first of a sensor after some time, which comes last."""
    readings, _ = flight(3, 8 * SECOND)
    readings.sort(key=lambda reading: reading.t_ns)
    last = next(i for i, r in enumerate(readings) if r.sensor == name and r.t_ns > start_s * SECOND)
    t_ns = readings[last].t_ns
    ahead = [r for r in readings if r.t_ns < t_ns or (r.t_ns == t_ns and r.sensor == "imu")]
    return records(aloft().layout, [*ahead, readings[last]])


def shifted(assembly, x, dx):
    """x [+] dx."""
    return Trial(assembly.resolved).shift(x, dx)


def test_a_withheld_gain_is_considered_not_estimated():
    """A body that stands still: its velocity along the ground corrects neither heading nor the bias that turns it.

    P is Joseph's of the gain used, channel by channel. The vertical one, which no turn of the world changes, has all
    of its gain.
    """
    readings, _ = standing(3, 2)
    readings.sort(key=lambda r: r.t_ns)
    readings = [r for r in readings if r.sensor != "gnss_position"]
    last = next(i for i, r in reversed(list(enumerate(readings))) if r.sensor == "gnss_velocity")
    readings = [r for r in readings[:last] if r.t_ns < readings[last].t_ns or r.sensor == "imu"] + [
        readings[last]
    ]
    readings.insert(-1, Reading(readings[-1].t_ns, "imu", (0.0, 0.0, 0.0, 0.0, 0.0, 9.80665)))
    assembly = still()
    x, P, x_after, P_after, report = before_and_after(assembly, records(assembly.layout, readings))
    seen = seen_by(assembly, "gnss_velocity", x, report)
    dx = Trial(assembly.resolved).error(x, x_after)
    P_expected, dx_expected, held = considered(P, seen, [GYRO_X, GYRO_X + 1, GYRO_Z, HEADING])
    assert all({GYRO_Z, HEADING} <= set(states) for states in held[:2])
    assert held[2] == []
    assert P_after == pytest.approx(P_expected, rel=1e-6, abs=1e-13)
    assert dx == pytest.approx(dx_expected, abs=1e-12)
    P_best, best, _ = considered(P, seen, [])
    assert abs(dx[HEADING]) < 0.01 * abs(best[HEADING])
    assert P_after[HEADING, HEADING] > P_best[HEADING, HEADING]


def considered(P, seen, guarded):
    """P, correction and states held, channel by channel, of the rule as it is written; R is diagonal."""
    dx, held = np.zeros(len(P)), []
    for h, nu, r in zip(seen.H, seen.nu, np.diagonal(seen.R), strict=True):
        turned = np.zeros(len(P))
        turned[[0, 1, 3, 4]] = h[1], -h[0], h[4], -h[3]
        column = P[:, HEADING]
        variance = turned @ (P - np.outer(column, column) / P[HEADING, HEADING]) @ turned
        limit = 3.0 * np.sqrt(max(variance, 0.0))
        held.append([j for j in guarded if variance > 0.0 and abs(P[j] @ h) <= limit * abs(column[j])])
        k = P @ h / (h @ P @ h + r)
        k[held[-1]] = 0.0
        dx = dx + k * (nu - h @ dx)
        kept = np.eye(len(P)) - np.outer(k, h)
        P = kept @ P @ kept.T + r * np.outer(k, k)
    return P, dx, held


def test_what_is_observed_is_learned_as_without_a_guard():
    """After 7 s of banking flight the update by a velocity is the best one, to rounding."""
    assembly = aloft()
    x, P, x_after, P_after, report = before_and_after(assembly, until("gnss_velocity", 7.0))
    seen = seen_by(assembly, "gnss_velocity", x, report)
    best, P_best = update(np.zeros(15), P, seen)
    assert x_after[:16] == pytest.approx(shifted(assembly, x, best)[:16], abs=1e-9)
    assert P_after == pytest.approx(P_best, rel=1e-6, abs=1e-12)


def turning_coordinates(x):
    """(15, 15) T with error = T (error whose position and velocity turn with the heading), Barrau's."""
    T = np.eye(15)
    for at in (0, 3):
        a, b, c = x[at : at + 3]
        T[at : at + 3, 12:] = -np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]])
    return T


def test_a_reading_in_the_body_s_axes_keeps_the_error_that_turns_with_the_heading():
    """Wheels: T^-1 P T'^-1 is conditioned, T of the state before; after, the same number stands at the new state."""
    assembly, (readings, _) = car(), drive()
    readings = sorted((r for r in readings if r.sensor != "standstill"), key=lambda r: r.t_ns)
    last = next(i for i, r in enumerate(readings) if r.sensor == "wheels" and r.t_ns > 30 * SECOND)
    batch = records(
        assembly.layout, [*[r for r in readings[:last] if r.t_ns <= readings[last].t_ns], readings[last]]
    )
    x, P, x_after, P_after, report = before_and_after(assembly, batch)
    seen = seen_by(assembly, "wheels", x, report)
    _, P_best = update(np.zeros(15), P, seen)
    J = turning_coordinates(x_after) @ np.linalg.inv(turning_coordinates(x))
    assert P_after == pytest.approx(J @ P_best @ J.T, rel=1e-6, abs=1e-10)
    north = np.zeros(15)
    north[14] = 1.0
    turn, turn_after = turning_coordinates(x) @ north, turning_coordinates(x_after) @ north
    assert seen.H @ turn == pytest.approx(np.zeros(3), abs=1e-12)
    assert seen_by(assembly, "wheels", x_after, report).H @ turn_after == pytest.approx(
        np.zeros(3), abs=1e-12
    )
    assert np.abs(seen_by(assembly, "wheels", x_after, report).H @ turn).max() > 0.0


def test_which_sensors_cannot_tell_one_heading_from_another():
    free = {s.name: bool(aloft().design["free"][0, s.number]) for s in aloft().layout.sensors}
    assert free == {
        "imu": False, "barometer": True, "gnss_position": False, "gnss_velocity": False, "magnetometer": False,
    }  # fmt: skip
    wheels = {s.name: bool(car().design["free"][0, s.number]) for s in car().layout.sensors}
    assert wheels == {"imu": False, "standstill": False, "wheels": True}


def test_late_readings_are_put_back_under_the_guard_too():
    """Arrivals out of order by up to 0.2 s end in the same bytes of the track."""
    assembly = aloft()
    readings = until("gnss_velocity", 4.0)
    rng = np.random.default_rng(2)
    late = readings["t_ns"] + (rng.random(len(readings)) < 0.05) * rng.integers(0, SECOND // 5, len(readings))
    straight, shuffled = assembly.engine(), assembly.engine()
    straight.process(readings)
    shuffled.process(readings[np.argsort(late, kind="stable")])
    assert not np.array_equal(np.argsort(late, kind="stable"), np.arange(len(readings)))
    for name in ("x", "U", "d", "learned", "learned_ns", "filter_t_ns"):
        assert np.array_equal(straight.track[0][name], shuffled.track[0][name]), name


@pytest.mark.parametrize(
    ("said", "why"),
    [('["gyro_bias_w"]', "no state `gyro_bias_w`"), ('["position"]', "knows no heading")],
)
def test_what_cannot_be_guarded_is_refused(said, why):
    section = f"[filter]\nguard_unobservable = {said}\n"
    text = toml_of(sections=section) if "position" in said else flight_text(section)
    with pytest.raises(ConfigError, match=why):
        assemble(parse(text, "test"))


def flight_text(section):
    """configs/flight.toml with one more section."""
    from pathlib import Path

    path = Path(__file__).resolve().parents[2] / "configs" / "flight.toml"
    return path.read_text(encoding="utf-8") + "\n" + section


def test_no_guard_is_kept_where_none_is_asked_for():
    config: Config = configured("flight", {"filter": {"guard_unobservable": []}}).config
    assert assemble(config).layout.shape.guarded == 0
    assert rig().layout.shape.guarded == 0


def test_a_reading_that_is_not_used_teaches_nothing():
    """A gated velocity leaves what is noted of learning as it was."""
    section = "[faults]\n" + 'profile = "sharp"\n'
    assembly = assemble(parse(flight_text("[filter]\nleave_one_out = false\n" + section), "flight"))
    engine, readings = assembly.engine(), until("gnss_velocity", 4.0)
    readings["z"][-1, :3] += 50.0
    engine.process(readings[:-1])
    before = engine.track[0]["learned"].copy()
    report = engine.process(readings[-1:])[0].copy()
    assert report["verdict"] == Verdict.GATED
    assert np.array_equal(engine.track[0]["learned"], before)
