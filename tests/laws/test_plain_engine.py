"""The plain step keeps the compiled one's contract: the same verdicts, order, late readings, health and commands."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.assembly.assembly import assemble
from fusiond.config import parse
from fusiond.errors import ConfigError
from fusiond.simulation.registry import simulate
from fusiond.types import Action, ServiceHealth, Verdict
from tests.laws.engine_rig import MS, SECOND, one, reading, rig, stream, tick, toml_of
from tools.pages.trials import configured, estimate

STEP = {
    "A": [[1.0, 0.02], [-0.008, 0.994]],
    "B": [[0.0], [0.02]],
    "Q": [[1e-3, 0.0], [0.0, 6e-3]],
    "step_s": 0.005,
}
"""The rig's model on a step: the interpreted integral of a continuous one takes milliseconds an interval."""
RECURSIONS = ("conventional", "information", "seed")
EXACT = ("stacked", "information", "federated_reset", "information_sum")
CAUTIOUS = ("seed_averaged", "federated", "covariance_intersection")
SAME = ("t_ns", "sensor", "verdict", "action", "dof", "length", "service", "health", "z", "seq", "state_t_ns")
"""Fields of a report that do not depend on how the state is estimated."""


def sections(*, recursion="ud", topology="centralized", more=""):
    return f'[filter]\nrecursion = "{recursion}"\nleave_one_out = false\n{more}\n[fusion]\ntopology = "{topology}"\n'


def plain(recursion="ud", topology="centralized", more="", **changes):
    return rig(model=STEP, sections=sections(recursion=recursion, topology=topology, more=more), **changes)


def shuffled(layout, count=80, seed=3):
    """Readings of all sensors, some of them late by up to a dozen places, one broken, one repeated, and ticks."""
    rng = np.random.default_rng(seed)
    readings = stream(layout, count, seed)
    order = np.argsort(np.arange(count) + rng.uniform(0.0, 12.0, count))
    mixed = readings[order]
    mixed["z"][10, 0] = np.nan
    mixed["length"][20] = 7
    now = int(mixed["t_ns"].max())
    return np.concatenate(
        [mixed, mixed[30:31], tick(layout, now + 40 * MS), mixed[:1], tick(layout, now + 3 * SECOND)]
    )


def assert_same_contract(mine, theirs):
    for field in SAME:
        assert np.array_equal(mine[field], theirs[field], equal_nan=field == "z"), field
    assert np.array_equal(mine["command_due"], theirs["command_due"])
    assert np.array_equal(mine["command_valid"], theirs["command_valid"])


@pytest.mark.parametrize(
    ("recursion", "topology"),
    [*((recursion, "centralized") for recursion in RECURSIONS), *(("ud", topology) for topology in EXACT)],
)
def test_every_exact_mode_is_the_compiled_engine(recursion, topology):
    """State, covariance and command to 1e-9 at the end, everything decided about each reading exactly."""
    compiled, engine = rig(model=STEP), plain(recursion, topology)
    expected = compiled.process(shuffled(compiled.layout)).copy()
    reports = engine.process(shuffled(engine.layout)).copy()
    assert (reports["action"] == Action.REPLAYED).any()
    assert {Verdict.NON_FINITE, Verdict.WRONG_LENGTH, Verdict.DUPLICATE} <= set(reports["verdict"])
    assert_same_contract(reports, expected)
    assert engine.track[0]["x"][0] == pytest.approx(compiled.track[0]["x"][0], abs=1e-9)
    assert engine.covariance() == pytest.approx(compiled.covariance(), abs=1e-9)
    assert engine.repairs == 0
    if topology in {"centralized", "federated_reset", "information_sum"}:
        for field in ("x", "std", "nu", "S", "e", "nis", "R_used", "R_declared", "command"):
            assert reports[field] == pytest.approx(expected[field], abs=1e-8), field


@pytest.mark.parametrize("topology", CAUTIOUS)
def test_a_mode_that_estimates_otherwise_decides_the_same(topology):
    compiled, engine = rig(model=STEP), plain(topology=topology)
    expected = compiled.process(shuffled(compiled.layout)).copy()
    assert_same_contract(engine.process(shuffled(engine.layout)), expected)
    assert np.isfinite(engine.covariance()).all()
    assert np.linalg.eigvalsh(engine.covariance() - compiled.covariance())[0] >= -1e-12


@pytest.mark.parametrize(
    ("recursion", "topology"),
    [("conventional", "centralized"), ("ud", "stacked"), ("ud", "federated"), ("ud", "seed_averaged")],
)
def test_late_readings_change_no_bit(recursion, topology):
    """Any order of arrival inside the horizon ends in the same record, counters of the guard included."""
    engine = plain(recursion, topology)
    readings = stream(engine.layout, 60, 5)
    engine.process(readings)
    in_order = engine.state_sha256()
    engine.reset()
    engine.process(readings[np.random.default_rng(1).permutation(60)])
    assert engine.state_sha256() == in_order


@pytest.mark.parametrize(
    ("recursion", "topology"), [("conventional", "centralized"), ("ud", "federated_reset")]
)
def test_a_nonlinear_model_is_linearised_where_the_compiled_engine_does(recursion, topology):
    """The planar robot with six sensors over two seconds: the same errors, yaw on the circle included, to 1e-9."""
    simulation = simulate("planar", 0, 2.0)
    compiled = estimate(configured("planar").engine(), simulation)
    choices = {"filter": {"recursion": recursion}, "fusion": {"topology": topology}}
    found = estimate(configured("planar", choices).engine(), simulation)
    assert found.reports["x"] == pytest.approx(compiled.reports["x"], abs=1e-8)
    assert pytest.approx(compiled.P, abs=1e-8) == found.P


def test_stacked_reports_hold_a_whole_estimate_each():
    """Three sensors with one stamp: after each, the estimate of all so far; after the last, that of the compiled."""
    compiled, engine = rig(model=STEP), plain(topology="stacked")
    for name, z in (("a", [0.3, 0.1]), ("b", [0.2, -0.4]), ("c", [0.5])):
        one(compiled, name, SECOND, z)
        report = one(engine, name, SECOND, z)
        assert report["x"] == pytest.approx(compiled.track[0]["x"][0], abs=1e-12)


def test_two_readings_of_one_sensor_with_one_stamp_are_two():
    """Numbered apart: the second starts a batch of its own from the first one's estimate."""
    compiled, engine = rig(model=STEP), plain(topology="stacked")
    for seq in (1, 2):
        one(compiled, "c", SECOND, [0.5 + seq], seq=seq)
        report = one(engine, "c", SECOND, [0.5 + seq], seq=seq)
    assert report["x"] == pytest.approx(compiled.track[0]["x"][0], abs=1e-12)


def test_covariances_are_kept_where_asked():
    engine = plain("conventional")
    readings = stream(engine.layout, 12, 4)
    engine.process(readings, covariances=True)
    kept = engine.covariances[:12].copy()
    engine.reset()
    for record, P in zip(readings, kept, strict=True):
        engine.process(record[None])
        assert np.array_equal(engine.covariance(), P)


def test_a_covariance_in_a_payload_that_is_none_is_refused_by_name():
    """Not symmetric, negative, infinite, indefinite: bad_covariance, and the state stays."""
    engine = plain("conventional")
    one(engine, "a", SECOND, [0.1, 0.2])
    before = engine.track[0]["x"][0].copy()
    for R in (
        [[1.0, 0.5], [0.0, 1.0]],
        [[-1.0, 0.0], [0.0, 1.0]],
        [[np.inf, 0.0], [0.0, 1.0]],
        [[1.0, 2.0], [2.0, 1.0]],
    ):
        report = one(engine, "a", SECOND + MS, [0.1, 0.2], R=R)
        assert report["verdict"] == Verdict.BAD_COVARIANCE
    assert np.array_equal(engine.track[0]["x"][0], before)


@pytest.mark.parametrize("recursion", RECURSIONS)
@pytest.mark.parametrize("variance", [0.0, 1e-300, 1e-30, 1e300, 1.7e308])
def test_no_declared_noise_ends_in_an_exception_or_nan(recursion, variance):
    engine = plain(recursion)
    for k in range(4):
        report = one(engine, "a", SECOND + k * 5 * MS, [0.1, 0.2], R=np.diag([variance, 0.1]))
    assert report["verdict"] == Verdict.USED
    assert np.isfinite(report["x"]).all()
    assert np.isfinite(report["std"]).all()


@pytest.mark.parametrize("policy", ["seed", "shift", "eigen_floor", "restore"])
def test_model_2_as_printed_repairs_a_singular_prior_and_counts_it(policy):
    """Two perfect readings leave P singular; each policy lets the recursion go on."""
    engine = plain("seed", more=f'guard = "{policy}"')
    one(engine, "a", SECOND, [0.1, 0.2], R=np.zeros((2, 2)))
    assert engine.repairs == 0
    report = one(engine, "c", SECOND, [0.1])
    assert engine.repairs >= 1
    assert engine.guard()["repairs"] == engine.repairs
    assert np.isfinite(report["x"]).all()
    engine.reset()
    assert engine.repairs == 0


def test_the_random_diagonal_is_seeded():
    """Equal seeds, equal bits; another seed, another record; and its size is that of its reading."""
    hashes = []
    for said in ("random_seed = 1", "random_seed = 1", "random_seed = 2"):
        engine = plain("seed", more=said)
        one(engine, "a", SECOND, [0.1, 0.2], R=np.zeros((2, 2)))
        one(engine, "c", SECOND, [0.1])
        hashes.append(engine.state_sha256())
    assert hashes[0] == hashes[1] != hashes[2]


def test_dead_reckoning_and_silence_are_judged_as_ever():
    engine = plain("information")
    one(engine, "a", SECOND, [0.1, 0.2])
    assert engine.process(tick(engine.layout, 3 * SECOND))[0]["service"] == ServiceHealth.DEAD_RECKONING
    assert engine.process(tick(engine.layout, 9 * SECOND))[0]["service"] == ServiceHealth.INVALID


@pytest.mark.parametrize(
    ("said", "named"),
    [
        (sections(recursion="conventional", topology="information"), "filter.recursion"),
        (sections(recursion="seed", topology="seed_averaged"), "filter.recursion"),
        (sections(more='guard = "shift"'), "filter.guard"),
        (
            sections(recursion="conventional", more='guard = "shift"\nseed_diagonal = "deviation"'),
            "filter.seed_diagonal",
        ),
        (sections(recursion="model1"), "filter.recursion"),
        (sections(topology="naive"), "fusion.topology"),
    ],
)
def test_a_choice_that_would_be_ignored_is_refused(said, named):
    with pytest.raises(ConfigError, match=named):
        assemble(parse(toml_of(model=STEP, sections=said), "rig"))


def test_the_compiled_engine_has_nothing_to_repair():
    engine = rig(model=STEP)
    engine.process(reading(engine.layout, "a", SECOND, [0.1, 0.2]))
    assert engine.repairs == 0
    assert engine.guard() == {}
    assert engine.honest_covariance() is None
