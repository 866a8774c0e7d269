"""Stacked, sequential, information, federated with full reset and the information sum are one filter."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusiond.filters import conventional, information, joseph
from fusiond.filters.innovation import Innovation
from fusiond.fusion import centralized, federated, information_sum
from tests.laws.seed_004_plant import ONE, A, B, C, noise

ROWS = (C, C, np.array([[0.0, 1.0, -0.5]]))
"""Three sensors, two of them on one output."""
R = (1.0 * ONE, 25.0 * ONE, 0.3 * ONE)
SHARES = (0.5, 0.2, 0.3)
Q = noise(2.3) + 0.01 * np.eye(3)


LAG = np.array([0.3, -0.2, 0.1])
"""A node of the information sum looks from its own mean, not from the centre's."""


def stacked(x, P, parts):
    return joseph.update(x, P, centralized.stacked(list(parts.values())))


def in_turn(x, P, parts):
    return centralized.update_sequential(x, P, list(parts.values()), joseph.update)


def as_information(x, P, parts):
    return information.update_together(x, P, list(parts.values()))


def federated_reset(x, P, parts):
    """Every sensor's own filter holds a share of the prior, meets its own reading, and all are merged."""
    own = [(x, P_i) for P_i in federated.split(P, SHARES)]
    for i, part in parts.items():
        own[i] = joseph.update(*own[i], part)
    return federated.merge(own)


def information_summed(x, P, parts):
    """Every reading is taken at its node's own mean, x + LAG."""
    after = x
    for part in parts.values():
        at_node = Innovation(part.nu - part.H @ LAG, part.H, part.R)
        after, P = information_sum.absorb(after, P, x + LAG, at_node)
    return after, P


MODES = (stacked, in_turn, as_information, federated_reset, information_summed)


def readings(rng, truth):
    """What the sensors that speak this time say, by number, in random order; about a third stay silent."""
    spoke = [i for i in rng.permutation(3).tolist() if rng.random() > 0.3]
    return {i: ROWS[i] @ truth + np.sqrt(R[i][0]) * rng.standard_normal() for i in spoke}


def difference(mine, theirs):
    """Largest difference of x and P, relative to the deviations."""
    (x, P), (x_ref, P_ref) = mine, theirs
    s = np.sqrt(np.diagonal(P_ref))
    return max(np.abs((x - x_ref) / s).max(), np.abs((P - P_ref) / s[:, None] / s[None, :]).max())


def worst_differences(steps, seed=0):
    """Run all modes side by side from the singular prior; largest difference of each from the first."""
    rng = np.random.default_rng(seed)
    held = {mode: (np.zeros(3), noise(2.3)) for mode in MODES}
    worst, truth, root = dict.fromkeys(MODES, 0.0), B[:, 0] * rng.standard_normal(), np.linalg.cholesky(Q)
    for k in range(steps):
        z = readings(rng, truth)
        drive = B[:, 0] * np.sin(k / 5.0)
        for mode, (x, P) in held.items():
            parts = {i: Innovation(value - ROWS[i] @ x, ROWS[i], R[i]) for i, value in z.items()}
            after, P_after = mode(x, P, parts) if parts else (x, P)
            held[mode] = A @ after + drive, conventional.predict(P_after, A, Q)
            if k % 50 == 0 or k == steps - 1:
                worst[mode] = max(worst[mode], difference(held[mode], held[stacked]))
        truth = A @ truth + drive + root @ rng.standard_normal(3)
    return worst


def test_every_exact_mode_is_the_stacked_filter_over_100_000_steps():
    """Random order, random dropouts, from the singular prior: 1e-9 relative to the deviations."""
    for mode, seen in worst_differences(100_000).items():
        assert seen <= 1e-9, mode.__name__


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
