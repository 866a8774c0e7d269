"""The UD kernels against dense algebra, FilterPy, and exact fractions."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fusiond.numerics.ud import (
    bierman_update,
    thornton_predict,
    ud_compose,
    ud_factor,
    ud_projected,
    ud_variance,
    whiten,
)

SEEDS = st.integers(0, 10**9)
SIZES = st.integers(1, 7)


def covariance(rng, n, rank):
    """A random semi-definite matrix of the given rank."""
    root = rng.standard_normal((n, rank))
    return root @ root.T


def factored(P, tolerance=1e-9):
    n = P.shape[0]
    U, d = np.eye(n), np.zeros(n)
    assert ud_factor(P.copy(), U, d, tolerance)
    return U, d


def composed(U, d):
    P = np.zeros((len(d), len(d)))
    ud_compose(U, d, P)
    return P


def updated(x, U, d, H, r, z):
    """Bierman, one row of H after the other; r are their variances."""
    n = len(x)
    a, b = np.zeros(n), np.zeros(n)
    S = [bierman_update(x, U, d, h, r_i, z_i - h @ x, a, b) for h, r_i, z_i in zip(H, r, z, strict=True)]
    assert (d >= 0.0).all()
    return S


def predicted(U, d, F, G, q):
    n, k = F.shape[0], G.shape[1]
    W, w_d = np.full((n + k, n), np.nan), np.full(n + k, np.nan)
    W[n:], w_d[n:] = G.T, q
    thornton_predict(U, d, F, W, w_d, np.zeros(n))
    assert (d >= 0.0).all()


def joseph(x, P, h, r, z):
    S = h @ P @ h + r
    K = P @ h / S
    A = np.eye(len(x)) - np.outer(K, h)
    return x + K * (z - h @ x), A @ P @ A.T + r * np.outer(K, K)


def exact_posterior(P, H, R):
    """P - P H' (H P H' + R)^-1 H P in fractions, for two rows; the floats are taken as they are."""
    P, H, R = ([[Fraction(v) for v in row] for row in M] for M in (P, H, R))

    def times(A, B):
        return [
            [sum(a * b for a, b in zip(row, column, strict=True)) for column in zip(*B, strict=True)]
            for row in A
        ]

    HP = times(H, P)
    Ht = [list(column) for column in zip(*H, strict=True)]
    S = [[s + r for s, r in zip(*rows, strict=True)] for rows in zip(times(HP, Ht), R, strict=True)]
    determinant = S[0][0] * S[1][1] - S[0][1] * S[1][0]
    inverse = [
        [S[1][1] / determinant, -S[0][1] / determinant],
        [-S[1][0] / determinant, S[0][0] / determinant],
    ]
    drop = times([list(column) for column in zip(*HP, strict=True)], times(inverse, HP))
    return np.array(
        [[float(p - q) for p, q in zip(*rows, strict=True)] for rows in zip(P, drop, strict=True)]
    )


@given(seed=SEEDS, n=SIZES, missing=st.integers(0, 7))
@settings(max_examples=60)
def test_factors_compose_to_what_was_factored(seed, n, missing):
    """Regular or singular, down to the zero matrix."""
    P = covariance(np.random.default_rng(seed), n, max(0, n - missing))
    U, d = factored(P)
    scale = max(1.0, np.abs(P).max())
    assert (d >= 0.0).all()
    assert np.diag(U) == pytest.approx(1.0)
    assert np.abs(composed(U, d) - P).max() <= 1e-7 * scale
    if missing == 0:
        assert np.abs(composed(U, d) - P).max() <= 1e-12 * scale


@given(seed=SEEDS, n=SIZES)
@settings(max_examples=30)
def test_an_indefinite_or_broken_matrix_is_refused(seed, n):
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.standard_normal((n, n)))[0]
    values = rng.uniform(0.5, 2.0, n)
    values[rng.integers(n)] *= -1.0
    for P in (turn * values @ turn.T, np.full((n, n), np.nan), np.full((n, n), np.inf)):
        assert not ud_factor(P, np.eye(n), np.zeros(n), 1e-9)


def test_a_covariance_without_variance_has_no_correlation():
    """[[0, 1], [1, 1]] has no negative diagonal, yet is indefinite."""
    for P in ([[0.0, 1.0], [1.0, 0.0]], [[1.0, 1.0], [1.0, 0.0]], [[0.0, 1.0], [1.0, 1.0]]):
        assert not ud_factor(np.array(P), np.eye(2), np.zeros(2), 1e-9)


@given(seed=SEEDS, n=SIZES)
@settings(max_examples=30)
def test_variance_and_projection_equal_dense(seed, n):
    rng = np.random.default_rng(seed)
    P = covariance(rng, n, n)
    U, d = factored(P)
    h = rng.standard_normal(n)
    assert [ud_variance(U, d, i) for i in range(n)] == pytest.approx(np.diag(P), rel=1e-10)
    assert ud_projected(U, d, h) == pytest.approx(h @ P @ h, rel=1e-9)


@given(seed=SEEDS, n=SIZES, rank=st.integers(0, 7))
@settings(max_examples=60)
def test_ud_equals_joseph(seed, n, rank):
    """One update from any prior, singular ones included; S is the variance of the innovation."""
    rng = np.random.default_rng(seed)
    P, x, h = covariance(rng, n, min(n, rank)), rng.standard_normal(n), rng.standard_normal(n)
    r, z = rng.uniform(0.01, 2.0), rng.standard_normal()
    U, d = factored(P)
    before = composed(U, d)
    x_joseph, P_joseph = joseph(x, before, h, r, z)
    (S,) = updated(x, U, d, [h], [r], [z])
    assert pytest.approx(h @ before @ h + r, rel=1e-10) == S
    assert x == pytest.approx(x_joseph, abs=1e-9)
    assert composed(U, d) == pytest.approx(P_joseph, abs=1e-9)
    assert (np.diag(composed(U, d)) <= np.diag(before) + 1e-9).all()


@given(seed=SEEDS, n=SIZES, k=st.integers(1, 5), rank=st.integers(0, 7))
@settings(max_examples=60)
def test_thornton_equals_dense(seed, n, k, rank):
    """F P F' + G Q G', with singular priors, singular transitions, and noises of variance zero."""
    rng = np.random.default_rng(seed)
    U, d = factored(covariance(rng, n, min(n, rank)))
    F, G, q = rng.standard_normal((n, n)), rng.standard_normal((n, k)), rng.uniform(0.0, 2.0, k)
    F[:, rng.integers(n)] *= rng.integers(2)
    q[rng.integers(k)] *= rng.integers(2)
    dense = F @ composed(U, d) @ F.T + (G * q) @ G.T
    predicted(U, d, F, G, q)
    assert composed(U, d) == pytest.approx(dense, rel=1e-9, abs=1e-9)


@given(seed=SEEDS, n=st.integers(1, 5), m=st.integers(1, 3))
@settings(max_examples=20)
def test_a_whole_run_equals_filterpy(seed, n, m):
    """Fifty steps of a random stable model, updates stacked there and channel by channel here."""
    rng = np.random.default_rng(seed)
    F = rng.standard_normal((n, n))
    F *= 0.95 / max(1e-3, np.abs(np.linalg.eigvals(F)).max())
    assume(np.abs(F).max() < 10.0)
    G, q = rng.standard_normal((n, n)), rng.uniform(0.01, 1.0, n)
    H, R = rng.standard_normal((m, n)), covariance(rng, m, m) + 0.1 * np.eye(m)
    oracle = KalmanFilter(dim_x=n, dim_z=m)
    oracle.F, oracle.Q, oracle.H, oracle.R, oracle.P = F, (G * q) @ G.T, H, R, np.eye(n)
    oracle.x = np.zeros((n, 1))
    x, U, d = np.zeros(n), np.eye(n), np.ones(n)
    R_U, R_d = factored(R)
    for _ in range(50):
        z = 3.0 * rng.standard_normal(m)
        oracle.predict()
        oracle.update(z.reshape(-1, 1))
        x = F @ x
        predicted(U, d, F, G, q)
        nu, rows = z - H @ x, H.copy()
        whiten(R_U, nu, rows, m)
        updated(x, U, d, rows, R_d, nu + rows @ x)
    assert x == pytest.approx(oracle.x[:, 0], abs=1e-9)
    assert composed(U, d) == pytest.approx(oracle.P, abs=1e-9)


@given(seed=SEEDS, m=st.integers(1, 5))
@settings(max_examples=30)
def test_whitened_channels_are_independent(seed, m):
    """U^-1 R U^-1' = diag(d): the same total information, channel by channel."""
    rng = np.random.default_rng(seed)
    R, H, nu = covariance(rng, m, m) + 0.01 * np.eye(m), rng.standard_normal((m, 4)), rng.standard_normal(m)
    U, d = factored(R)
    upper = np.triu(U, 1) + np.eye(m)
    rows, white = H.copy(), nu.copy()
    whiten(U, white, rows, m)
    assert upper @ np.diag(d) @ upper.T == pytest.approx(R, abs=1e-10)
    assert upper @ rows == pytest.approx(H, abs=1e-9)
    assert (rows.T / d) @ rows == pytest.approx(H.T @ np.linalg.solve(R, H), rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("exponent", range(2, 13))
def test_the_ill_conditioned_update_keeps_four_digits(exponent):
    """Grewal and Andrews' case, H = [1 1 1; 1 1 1+delta], R = delta^2 I, P0 = I: relative error of P <= 1e-4.

    Joseph's form has lost every digit at delta = 1e-9. No entry of d is negative, so P = U diag(d) U' has no
    negative eigenvalue; composed in doubles it may show one by rounding, no larger than rounding.
    """
    delta = 10.0**-exponent
    H = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0 + delta]])
    x, U, d = np.zeros(3), np.eye(3), np.ones(3)
    updated(x, U, d, H, [delta**2] * 2, [0.0, 0.0])
    reference = exact_posterior(np.eye(3), H, np.diag([delta**2] * 2))
    P = composed(U, d)
    assert np.linalg.norm(P - reference) <= 1e-4 * np.linalg.norm(reference)
    assert np.linalg.eigvalsh(P)[0] >= -4.0 * np.finfo(float).eps * np.trace(P)


def test_the_exact_reference_agrees_with_dense_algebra():
    rng = np.random.default_rng(3)
    P, H, R = covariance(rng, 3, 3), rng.standard_normal((2, 3)), np.diag([0.3, 0.7])
    dense = P - P @ H.T @ np.linalg.solve(H @ P @ H.T + R, H @ P)
    assert exact_posterior(P, H, R) == pytest.approx(dense, rel=1e-12)


def test_a_perfect_reading_pins_the_state():
    """r = 0: the state agrees with the reading exactly, its variance along h is zero."""
    x, (U, d) = np.zeros(2), factored(np.array([[2.0, 0.5], [0.5, 1.0]]))
    h = np.array([1.0, 1.0])
    updated(x, U, d, [h], [0.0], [3.0])
    assert h @ x == pytest.approx(3.0, abs=1e-14)
    assert ud_projected(U, d, h) == pytest.approx(0.0, abs=1e-15)


def test_a_repeated_perfect_reading_changes_nothing():
    """A second perfect sensor of the same number has S = 0: no division by it, no nan, no change."""
    x, (U, d) = np.zeros(3), factored(covariance(np.random.default_rng(5), 3, 3))
    h = np.array([1.0, 0.0, 0.0])
    updated(x, U, d, [h], [0.0], [3.0])
    before = x.copy(), composed(U, d)
    updated(x, U, d, [h, h], [0.0, 0.0], [3.0, 7.0])
    assert np.array_equal(x, before[0])
    assert composed(U, d) == pytest.approx(before[1], abs=1e-14)


def test_a_known_state_learns_nothing():
    """P = 0: the state stays, S is the sensor's own variance."""
    x, U, d = np.ones(3), np.eye(3), np.zeros(3)
    assert updated(x, U, d, [np.array([1.0, 2.0, 3.0])], [0.5], [100.0]) == [0.5]
    assert np.array_equal(x, np.ones(3))
    assert not d.any()


@given(seed=SEEDS)
@settings(max_examples=20)
def test_a_rank_one_prior_moves_along_its_direction_only(seed):
    rng = np.random.default_rng(seed)
    g, h = rng.standard_normal(4), rng.standard_normal(4)
    x, (U, d) = np.zeros(4), factored(np.outer(g, g))
    updated(x, U, d, [h], [0.1], [1.0])
    along = g * (h @ g) / ((h @ g) ** 2 + 0.1)
    assert x == pytest.approx(along, abs=1e-7)


@pytest.mark.parametrize("eigenvalue", [0.9, 1.0, 1.01])
def test_a_mode_nobody_observes_never_turns_negative(eigenvalue):
    """Ten thousand steps beside a perfectly noisy neighbour: its variance follows the closed form."""
    U, d, x = np.eye(2), np.ones(2), np.zeros(2)
    F, G, q = np.diag([0.5, eigenvalue]), np.eye(2), np.array([1.0, 1e-4])
    steps = 10_000 if eigenvalue <= 1.0 else 1_000
    for _ in range(steps):
        predicted(U, d, F, G, q)
        updated(x, U, d, [np.array([1.0, 0.0])], [0.1], [0.0])
    square = eigenvalue**2
    grown = square**steps
    noise = 1e-4 * (steps if square == 1.0 else (grown - 1.0) / (square - 1.0))
    assert ud_variance(U, d, 1) == pytest.approx(grown + noise, rel=1e-9)


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_a_change_of_units_changes_only_the_units(scale):
    rng = np.random.default_rng(7)
    P, H, z = covariance(rng, 3, 3), rng.standard_normal((2, 3)), rng.standard_normal(2)
    T = np.diag([scale, 1.0, 1.0 / scale])
    x, (U, d) = np.zeros(3), factored(P)
    y, (V, e) = np.zeros(3), factored(T @ P @ T)
    updated(x, U, d, H, [0.1, 0.2], z)
    updated(y, V, e, H @ np.linalg.inv(T), [0.1, 0.2], z)
    assert y == pytest.approx(T @ x, rel=1e-9)
    assert composed(V, e) == pytest.approx(T @ composed(U, d) @ T, rel=1e-9)
