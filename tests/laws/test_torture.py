"""The compiled UD engine where other filters break: no NaN, no negative eigenvalue, no dependence on units.

Every case runs on one compiled step: three states, two sensors of two channels; only numbers change.
"""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.assembly.assembly import assemble
from fusiond.config import parse
from fusiond.engine.engine import Engine
from fusiond.engine.records import HAS_R
from fusiond.numerics.discretise import van_loan
from fusiond.types import Verdict
from tests.laws.test_ud import exact_posterior

STEP_NS = 10_000_000
A = np.array([[1.0, 0.01, 0.0], [-0.02, 0.98, 0.01], [0.0, 0.0, 0.9]])
G = np.array([[0.0, 0.0], [0.1, 0.0], [0.0, 0.2]])
Q = np.array([[1.0, 0.3], [0.3, 0.5]])
H = {"p": np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.5]]), "q": np.array([[1.0, 0.0, 0.2], [0.3, 0.0, 1.0]])}
STD = {"p": (0.1, 0.3), "q": (0.2, 0.05)}
FIRST_NS = 10**9
UNIT, ORIGIN, ONES = np.eye(3), np.zeros(3), np.ones(3)
TWINS = {"p": H["p"], "q": H["p"]}


def engine_of(*, A=A, G=G, Q=Q, H=H, STD=STD, P0=UNIT, x0=ORIGIN, u=ONES):
    """An engine with these numbers, in units of the states u_i: x' = x / u, so P' = P / (u u')."""
    scaled_A, scaled_G = A / u[:, None] * u, G / u[:, None]
    lines = [
        'name = "torture"', "[model]", 'kind = "linear"', "step_s = 0.01", 'states = ["a", "b", "c"]',
        f"A = {scaled_A.tolist()}", f"G = {scaled_G.tolist()}", f"Q = {Q.tolist()}",
        "[initial]", "std = { a = 1.0, b = 1.0, c = 1.0 }",
        "[filter]", 'accept_unobservable = ["a", "b", "c"]', "[history]", "horizon_s = 0.1", "max_ahead_s = 1e5",
    ]  # fmt: skip
    for name, rows in H.items():
        std = ", ".join(f"z{i} = {s}" for i, s in enumerate(STD[name]))
        lines += [
            f"[sensor.{name}]",
            'kind = "linear"',
            f"H = {(rows * u).tolist()}",
            f"noise_std = {{ {std} }}",
        ]
    engine = assemble(parse("\n".join(lines), "torture")).engine()
    start_at(engine, P0 / u[:, None] / u, x0 / u)
    return engine


def start_at(engine: Engine, P0: np.ndarray, x0: np.ndarray) -> None:
    """Any start, singular ones included: P0 = U diag(d) U' by hand."""
    U, d, P = np.eye(3), np.zeros(3), P0.copy()
    for j in (2, 1, 0):
        d[j] = max(P[j, j], 0.0)
        if d[j] > 0.0:
            U[:j, j] = P[:j, j] / d[j]
        P = P - d[j] * np.outer(U[:, j], U[:, j])
    design = engine._design[0]
    design["U0"], design["d0"], design["x0"] = U, d, x0
    engine.reset()


def readings(engine, count, seed=0, first=0, sensors=("p", "q"), R=None):
    """`count` stamps, a step apart, one reading of each sensor at each."""
    rng = np.random.default_rng(seed)
    k = len(sensors)
    records = np.zeros(count * k, engine.layout.reading)
    records["t_ns"] = np.repeat(FIRST_NS + STEP_NS * (first + np.arange(count)), k)
    records["sensor"] = np.tile([engine.layout.numbers[name] for name in sensors], count)
    records["length"] = 2
    records["z"] = rng.standard_normal((count * k, 2))
    if R is not None:
        records["flags"], records["R"] = HAS_R, R
    return records


def assert_sound(engine, *, finite=True):
    """Every filter of the bank: no NaN, and no eigenvalue below -1e-12 trace."""
    for row in range(engine.layout.shape.filters):
        U = np.triu(engine.track[0]["U"][row], 1) + np.eye(3)
        d = engine.track[0]["d"][row]
        P = (U * d) @ U.T
        assert not np.isnan(P).any()
        assert (d >= 0.0).all()
        if finite:
            assert np.isfinite(engine.track[0]["x"][row]).all()
            s = np.sqrt(np.diagonal(P))
            s = np.where(s > 0.0, s, 1.0)
            C = P / s[:, None] / s
            assert np.linalg.eigvalsh(C)[0] >= -1e-12 * np.trace(C)


RANK_1 = np.outer([1.0, -0.5, 2.0], [1.0, -0.5, 2.0])
NOTHING = {"p": (0.0, 0.0), "q": (0.0, 0.0)}
CASES = {
    "a perfect channel": {"STD": {"p": (0.0, 0.3), "q": (0.2, 0.05)}},
    "a perfect sensor": {"STD": {"p": (0.0, 0.0), "q": (0.2, 0.05)}},
    "perfect sensors": {"STD": NOTHING},
    "perfect and equal sensors": {"STD": NOTHING, "H": TWINS},
    "nearly perfect and equal sensors": {"STD": {"p": (1e-12,) * 2, "q": (1e-12,) * 2}, "H": TWINS},
    "a known start": {"P0": np.zeros((3, 3))},
    "a start of rank 1": {"P0": RANK_1},
    "a start of rank 1, perfect sensors": {"P0": RANK_1, "STD": NOTHING},
    "an unknown start": {"P0": 1e12 * np.eye(3)},
    "an unknown start, perfect sensors": {"P0": 1e12 * np.eye(3), "STD": NOTHING},
    "tiny covariances": {"P0": 1e-14 * np.eye(3), "Q": 1e-14 * Q, "STD": {"p": (1e-7, 1e-7), "q": (1e-7, 1e-7)}},
    "no process noise": {"Q": np.zeros((2, 2))},
    "no noise at all": {"Q": np.zeros((2, 2)), "STD": NOTHING},
    "no noise, known start": {"Q": np.zeros((2, 2)), "STD": NOTHING, "P0": np.zeros((3, 3))},
    "singular process noise": {"Q": np.array([[1.0, 1.0], [1.0, 1.0]])},
    "the same channel twice": {"H": {"p": H["p"][[0, 0]], "q": H["q"]}, "STD": {"p": (0.0, 0.0), "q": (0.2, 0.05)}},
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
def test_nothing_degenerate_breaks_the_engine(case):
    """300 steps of both sensors, all filters of the bank, an eigenvalue check after each reading."""
    engine = engine_of(**CASES[case])
    reports = engine.process(readings(engine, 300), covariances=True)
    assert (reports["verdict"] == Verdict.USED).all()
    assert np.isfinite(reports["x"]).all()
    assert np.isfinite(reports["nis"]).all()
    assert_sound(engine)
    smallest = np.linalg.eigvalsh(engine.covariances[:600])[:, 0]
    assert (smallest >= -1e-12 * np.trace(engine.covariances[:600], axis1=1, axis2=2)).all()


@pytest.mark.parametrize(
    "case", ["an unknown start", "a start of rank 1", "perfect sensors", "a perfect channel"]
)
def test_results_do_not_depend_on_units(case):
    """States in nanometres or gigametres: x and P to 1e-9 of their deviations, or of a millionth of those once had."""
    plain = engine_of(**CASES[case])
    expected = plain.process(readings(plain, 200), covariances=True).copy()
    P = plain.covariances[:400].copy()
    for exponents in ((-9, 0, 9), (9, 9, -9), (-9, -9, -9), (3, -6, 0)):
        u = 10.0 ** np.array(exponents)
        engine = engine_of(**CASES[case], u=u)
        reports = engine.process(readings(engine, 200), covariances=True)
        s = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
        s = np.maximum(s, 1e-6 * np.maximum(s.max(axis=0), np.sqrt(np.diagonal(CASES[case].get("P0", UNIT)))))
        back = engine.covariances[:400] * u[:, None] * u
        assert np.abs((back - P) / s[:, :, None] / s[:, None, :]).max() <= 1e-9
        assert np.abs((reports["x"] * u - expected["x"]) / (s + np.abs(expected["x"]))).max() <= 1e-9
        assert reports["nis"] == pytest.approx(expected["nis"], rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("d", [1e-4, 1e-6, 1e-8, 1e-10, 1e-12])
def test_an_ill_conditioned_reading_costs_no_more_than_a_square_root(d):
    """H = [1 1 1; 1 1 1+d], R = d^2 I, P0 = I, against exact fractions: within 1e-4 even at d = 1e-12."""
    rows, R = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0 + d]]), np.diag([d * d, d * d])
    engine = engine_of(H={"p": rows, "q": H["q"]}, STD={"p": (d, d), "q": (0.2, 0.05)})
    engine.process(readings(engine, 1, sensors=("p",)))
    exact = exact_posterior(np.eye(3), rows, R)
    assert np.linalg.norm(engine.covariance() - exact) / np.linalg.norm(exact) <= 1e-4
    assert_sound(engine)


MILLION = 1_000_000
MODES = {"stable": 0.999, "marginal": 1.0, "unstable": 1.0001}


@pytest.mark.parametrize("mode", MODES)
def test_a_million_steps_with_a_mode_nobody_sees(mode):
    """The third state is read by nobody: its variance settles, grows like k or like a^2k, and the rest is untouched."""
    a = MODES[mode]
    blind = {"p": np.array([[1.0, 0, 0], [0, 1.0, 0]]), "q": np.array([[1.0, 0, 0], [0.3, 0.5, 0]])}
    moves = np.array([[1.0, 0.01, 0.0], [-0.02, 0.98, 0.0], [0.0, 0.0, a]])
    engine = engine_of(A=moves, H=blind, P0=np.eye(3))
    for block in range(10):
        engine.process(readings(engine, MILLION // 10, block, first=block * MILLION // 10, sensors=("p",)))
        assert_sound(engine)
    q = Q[1, 1] * 0.2**2
    steps = MILLION - 1
    grown = a ** (2 * steps)
    expected = grown + q * (steps if a == 1.0 else (grown - 1.0) / (a * a - 1.0))
    # Q correlates the seen and the unseen noise, so readings of the seen take a part of it
    assert expected * 0.5 < engine.covariance()[2, 2] <= expected * (1.0 + 1e-6)
    assert engine.covariance()[0, 0] < 0.01


def test_a_mode_that_overflows_stays_finite_and_alone():
    """a = 1.05 passes the largest number after 14,500 steps; variance and state stop short, the rest is untouched."""
    blind = {"p": np.array([[1.0, 0, 0], [0, 1.0, 0]]), "q": np.array([[1.0, 0, 0], [0.3, 0.5, 0]])}
    moves = np.array([[1.0, 0.01, 0.0], [-0.02, 0.98, 0.0], [0.0, 0.0, 1.05]])
    engine = engine_of(A=moves, H=blind, P0=np.eye(3))
    reports = engine.process(readings(engine, 50_000, sensors=("p",)))
    assert np.isfinite(reports["x"]).all()
    assert np.isfinite(reports["std"]).all()
    assert (engine.track[0]["d"][0] >= 0.0).all()
    assert reports["std"][-1, 2] > 1e140
    assert reports["std"][-1, 0] < 0.1


def test_a_million_steps_without_process_noise():
    """Q = 0: a constant read a million times is known to sigma / sqrt(k), to 1e-6."""
    engine = engine_of(
        A=np.eye(3), Q=np.zeros((2, 2)), H={"p": np.eye(3)[:2], "q": np.eye(3)[1:]}, P0=1e6 * np.eye(3)
    )
    for block in range(10):
        engine.process(readings(engine, MILLION // 10, block, first=block * MILLION // 10, sensors=("p",)))
    assert_sound(engine)
    assert engine.covariance()[0, 0] == pytest.approx(0.1**2 / MILLION, rel=1e-6)


@pytest.mark.parametrize("variance", [1.7e308, 1e300, 1e-300, 0.0])
def test_an_extreme_declared_noise_is_survived(variance):
    """A reading that says nothing changes nothing; one that says everything is believed."""
    engine = engine_of()
    engine.process(readings(engine, 20))
    before = engine.covariance()
    reports = engine.process(readings(engine, 5, first=20, R=variance * np.eye(2)))
    assert (reports["verdict"] == Verdict.USED).all()
    assert np.isfinite(reports["x"]).all()
    assert_sound(engine)
    if variance > 1.0:
        assert np.trace(engine.covariance()) > np.trace(before)


@pytest.mark.parametrize("value", [np.inf, np.nan, -1.0, 1.8e308])
def test_an_impossible_declared_noise_is_refused_by_name(value):
    """1.8e308 is more than a float holds and arrives as infinity."""
    engine = engine_of()
    engine.process(readings(engine, 5))
    before = engine.state_sha256()
    reports = engine.process(readings(engine, 2, first=5, R=np.diag([value, 1.0])))
    assert (reports["verdict"] == Verdict.BAD_COVARIANCE).all()
    assert engine.state_sha256() == before


@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan])
def test_a_reading_that_is_not_finite_is_refused_by_name(value):
    engine = engine_of()
    engine.process(readings(engine, 5))
    before = engine.state_sha256()
    broken = readings(engine, 2, first=5)
    broken["z"][:, 1] = value
    assert (engine.process(broken)["verdict"] == Verdict.NON_FINITE).all()
    assert engine.state_sha256() == before


def test_a_long_dropout_and_a_burst():
    """An hour of silence, then a hundred readings of one stamp: as sure as R allows, and sound."""
    engine = engine_of()
    engine.process(readings(engine, 50))
    burst = readings(engine, 100, first=360_000)
    burst["t_ns"] = burst["t_ns"][0]
    burst["sensor"].sort()  # in the engine's own order: no reading is late, the hour is predicted once
    burst["seq"] = np.arange(200)
    burst["z"] += np.arange(200)[:, None] * 1e-6
    engine.process(burst)
    assert_sound(engine)
    information = np.linalg.inv(engine.covariance())
    read = sum(100 * rows.T @ np.diag(1.0 / np.square(STD[name])) @ rows for name, rows in H.items())
    assert np.linalg.eigvalsh(information - read)[0] >= -1e-6 * np.trace(read)


@pytest.mark.parametrize("dt_s", [1e-9, 1e-3, 1.0, 3600.0])
def test_the_exact_integral_of_a_stiff_model_is_sound(dt_s):
    """Rates from 1e-3 to 1e4 per second over a nanosecond or an hour."""
    stiff = np.array([[-1e4, 1.0, 0.0], [0.0, -1.0, 1.0], [0.0, 0.0, -1e-3]])
    F, _, Q_d = van_loan(stiff, np.zeros((3, 1)), np.diag([0.0, 0.0, 1.0]), dt_s)
    assert np.isfinite(F).all()
    assert np.linalg.eigvalsh(Q_d)[0] >= -1e-12 * np.trace(Q_d)
