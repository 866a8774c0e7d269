"""The guard of a covariance: what it sees, what it repairs, and that no repair makes a filter surer than it was."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusiond.filters import conventional
from fusiond.filters.innovation import Innovation
from fusiond.numerics.covariance import POLICIES, examine, repair
from tests.laws.test_ud import exact_posterior
from tools.pages.ill_conditioned import exact, outcome

SEEDS = st.integers(0, 10**9)


def units_of(rng, n):
    return 10.0 ** rng.uniform(-9.0, 9.0, n)


def unsound(seed):
    """A covariance with units from nano to giga, indefinite by up to a tenth, and the sound one it came from."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 7))
    turn, s = np.linalg.qr(rng.standard_normal((n, n)))[0], units_of(rng, n)
    values = 10.0 ** rng.uniform(-6.0, 0.0, n)
    sound = turn * values @ turn.T
    values[rng.integers(n)] = -(10.0 ** rng.uniform(-9.0, -1.0))
    broken = turn * values @ turn.T
    return broken * s[:, None] * s, sound * s[:, None] * s, s


@given(seed=SEEDS, policy=st.sampled_from(POLICIES), regular=st.booleans())
@settings(max_examples=150)
def test_no_repair_lowers_any_variance(seed, policy, regular):
    """In every direction, the well-observed ones included: v' P_repaired v >= v' P v."""
    P, before, s = unsound(seed)
    fixed = repair(P, policy, before=before, diagonal=1e-7 * np.ones(len(P)), regular=regular)
    gap = (fixed.P - P) / s[:, None] / s
    assert np.linalg.eigvalsh(0.5 * (gap + gap.T))[0] >= -1e-14 * max(1.0, np.abs(gap).max())
    if policy != "seed":
        assert fixed.sound
        assert examine(fixed.P).sound(regular)


@given(seed=SEEDS, policy=st.sampled_from(["shift", "eigen_floor", "restore"]))
@settings(max_examples=60)
def test_a_repair_does_not_depend_on_units(seed, policy):
    P, before, s = unsound(seed)
    t = units_of(np.random.default_rng(seed + 1), len(P))
    one = repair(P, policy, before=before, diagonal=s, regular=True)
    other = repair(P * t[:, None] * t, policy, before=before * t[:, None] * t, diagonal=s, regular=True)
    deviations = np.sqrt(np.diagonal(one.P))
    back = other.P / t[:, None] / t
    expected = one.P / deviations[:, None] / deviations
    assert back / deviations[:, None] / deviations == pytest.approx(expected, abs=1e-9)


def test_the_seeds_repair_depends_on_units():
    """diag |N(0, 1e-14)|, deviation 1e-7: enough for metres, nothing for the same state in nanometres."""
    P, diagonal = np.array([[1.0, 1.0], [1.0, 1.0]]), np.full(2, 1e-7)
    metres = repair(P, "seed", before=P, diagonal=diagonal, regular=True)
    nanometres = repair(P * 1e18, "seed", before=P, diagonal=diagonal, regular=True)
    assert metres.sound
    assert not nanometres.sound


@pytest.mark.parametrize("policy", POLICIES)
def test_asymmetry_is_seen_and_taken_away(policy):
    """As zeroed gain rows leave it; no variance changes."""
    P = np.array([[2.0, 0.5], [0.5 + 1e-6, 1.0]])
    assert not examine(P).sound(False)
    fixed = repair(P, policy, before=P, diagonal=np.ones(2), regular=False)
    assert fixed.sound
    assert np.array_equal(fixed.P, fixed.P.T)
    assert np.diagonal(fixed.P) == pytest.approx([2.0, 1.0], rel=1e-15)
    assert 0.0 < fixed.size < 1e-6


def test_rounding_is_not_a_fault():
    P = np.array([[1.0, 1.0], [1.0 + 1e-15, 1.0]])
    assert examine(P).sound(False)
    assert not examine(P).sound(True)
    assert examine(np.eye(3)).condition == pytest.approx(1.0)
    assert examine(np.diag([1.0, 1e12])).condition == pytest.approx(1.0)
    assert examine(np.array([[1.0, 2.0], [2.0, 1.0]])).condition == np.inf


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_not_finite_only_restore_can_replace(value):
    P, before = np.full((2, 2), value), np.eye(2)
    for policy in POLICIES:
        fixed = repair(P, policy, before=before, diagonal=np.ones(2), regular=False)
        assert fixed.sound == (policy == "restore")


def test_restore_keeps_what_has_grown_since():
    """Covers both the last sound covariance and the unsound one."""
    before, P = np.diag([1.0, 1.0]), np.diag([4.0, -0.1])
    assert (
        pytest.approx(np.diag([4.0, 1.0]))
        == repair(P, "restore", before=before, diagonal=np.ones(2), regular=False).P
    )


def test_restore_without_anything_sound_before_lifts():
    """A singular start: what came before is no better."""
    P = np.ones((2, 2))
    fixed = repair(P, "restore", before=P, diagonal=np.ones(2), regular=True)
    assert fixed.sound
    assert np.diagonal(fixed.P) == pytest.approx([1.0, 1.0])


def test_an_unknown_policy_is_a_programmers_mistake():
    with pytest.raises(ValueError, match="jitter"):
        repair(-np.eye(2), "jitter", before=np.eye(2), diagonal=np.ones(2), regular=False)


def test_the_ill_conditioned_update_costs_what_the_table_says():
    """Grewal & Andrews: Model 1 loses definiteness, UD keeps the digits that any algorithm can."""
    assert outcome("conventional", 1e-4)[0] < 1e-6
    assert outcome("conventional", 1e-6)[0] > 1e-6
    assert outcome("conventional", 1e-7)[1] < 0.0
    assert outcome("conventional", 1e-8)[0] > 0.1
    assert outcome("joseph", 1e-8)[0] > 0.1
    for d, worst in ((1e-4, 1e-11), (1e-6, 1e-8), (1e-8, 1e-6), (1e-12, 1e-4)):
        error, smallest = outcome("ud", d)
        assert error < worst
        assert smallest >= -1e-15


@pytest.mark.parametrize("d", [1e-3, 1e-8])
def test_the_fractions_agree_with_those_of_the_ud_laws(d):
    H = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0 + d]])
    assert exact(d) == pytest.approx(exact_posterior(np.eye(3), H, np.diag([d * d, d * d])), rel=1e-15)


@pytest.mark.parametrize("d", [1e-6, 1e-7, 1e-8])
def test_the_guard_catches_what_model_1_breaks(d):
    """Each policy but the seed's leaves a sound covariance; none is surer anywhere than Model 1's own."""
    H, R = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0 + d]]), np.diag([d * d, d * d])
    P = conventional.update(np.zeros(3), np.eye(3), Innovation(np.zeros(2), H, R))[1]
    assert not examine(P).sound(False)
    for policy in ("shift", "eigen_floor", "restore"):
        fixed = repair(P, policy, before=np.eye(3), diagonal=np.ones(3), regular=False)
        assert fixed.sound
        assert np.linalg.eigvalsh(fixed.P - 0.5 * (P + P.T))[0] >= -1e-12
