"""Stacked, sequential, information, federated with full reset and the information sum are one filter."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusiond.filters import joseph
from fusiond.filters.innovation import Innovation
from fusiond.fusion import federated, information_sum
from tools.pages.exact_modes import worst_differences


def test_every_exact_mode_is_the_stacked_filter_over_100_000_steps():
    """Random order, random dropouts, from the singular prior: 1e-9 relative to the deviations."""
    for mode, seen in worst_differences(100_000).items():
        assert seen <= 1e-9, mode


@given(seed=st.integers(0, 10**9))
@settings(max_examples=30)
def test_what_a_node_sends_is_what_its_reading_told_it(seed):
    """P+^-1 - P-^-1 = C' R^-1 C and its information state, whatever the node's own prior."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((3, 3))
    x, P = rng.standard_normal(3), root @ root.T + 0.2 * np.eye(3)
    seen = Innovation(
        rng.standard_normal(1), rng.standard_normal((1, 3)), np.array([[rng.uniform(0.1, 5.0)]])
    )
    y, Y = information_sum.difference((x, P), joseph.update(x, P, seen))
    W = np.linalg.inv(seen.R)
    assert pytest.approx(seen.H.T @ W @ seen.H, abs=1e-8) == Y
    assert y == pytest.approx(seen.H.T @ W @ (seen.nu + seen.H @ x), abs=1e-8)


@given(seed=st.integers(0, 10**9), missing=st.integers(0, 3))
@settings(max_examples=40)
def test_merging_shares_gives_back_the_whole(seed, missing):
    """split, then merge: the same estimate, also of singular covariances and where the means agree."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((4, 4 - missing)) * 10.0 ** rng.uniform(-6, 6, (4, 1))
    x, P = rng.standard_normal(4), root @ root.T
    x_2, P_2 = federated.merge([(x, P_i) for P_i in federated.split(P, (0.6, 0.3, 0.1))])
    s = np.sqrt(np.diagonal(P))
    assert x_2 == pytest.approx(x, rel=1e-12)
    assert P_2 / s[:, None] / s == pytest.approx(P / s[:, None] / s, abs=1e-9)


def test_an_estimate_that_is_not_finite_is_left_out_of_the_merge():
    """A local filter whose unobserved, unstable mode has overflowed must not take the others with it."""
    sound = (np.ones(2), np.eye(2))
    x, P = federated.merge([(np.ones(2), np.full((2, 2), np.inf)), sound])
    assert x == pytest.approx(sound[0])
    assert pytest.approx(sound[1]) == P


def test_shares_follow_information_and_sum_to_one():
    b = federated.shares([4.0, 1.0, 0.0])
    assert sum(b) == pytest.approx(1.0)
    assert b[0] / b[1] == pytest.approx(4.0)
    assert b[2] > 0.0
    assert federated.shares([0.0, 0.0]) == (0.5, 0.5)
