"""The exact interval of a linear model: against scipy's exponential, quadrature, and its own halves."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from fusiond.numerics.discretise import van_loan, wrap_angle

SEEDS = st.integers(0, 10**9)


def system(seed, n, m=2):
    """A (n, n), B (n, m) and a semi-definite spectral density of rank n - 1."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((n, max(1, n - 1)))
    return rng.standard_normal((n, n)), rng.standard_normal((n, m)), root @ root.T


@given(seed=SEEDS, n=st.integers(1, 6), dt_s=st.sampled_from([0.0, 1e-6, 1e-3, 0.1, 1.0, 3.0]))
@settings(max_examples=40)
def test_transition_and_drive_equal_scipys_exponential(seed, n, dt_s):
    A, B, density = system(seed, n)
    F, B_d, _ = van_loan(A, B, density, dt_s)
    block = scipy.linalg.expm(np.block([[A, B], [np.zeros((2, n + 2))]]) * dt_s)
    scale = max(1.0, np.abs(block).max())
    assert np.abs(F - block[:n, :n]).max() <= 1e-11 * scale
    assert np.abs(B_d - block[:n, n:]).max() <= 1e-11 * scale


@given(seed=SEEDS, n=st.integers(1, 4), dt_s=st.sampled_from([1e-3, 0.1, 1.0]))
@settings(max_examples=15)
def test_noise_equals_quadrature(seed, n, dt_s):
    """Q = integral of exp(A s) density exp(A' s) over the interval."""
    A, B, density = system(seed, n)
    _, _, Q = van_loan(A, B, density, dt_s)

    def integrand(s):
        Phi = scipy.linalg.expm(A * s)
        return (Phi @ density @ Phi.T).ravel()

    expected = scipy.integrate.quad_vec(integrand, 0.0, dt_s, epsabs=1e-13, epsrel=1e-12)[0].reshape(n, n)
    assert np.abs(Q - expected).max() <= 1e-9 * np.abs(expected).max()


@given(seed=SEEDS, n=st.integers(1, 5), dt_s=st.floats(1e-3, 2.0), share=st.floats(0.1, 0.9))
@settings(max_examples=30)
def test_two_parts_make_the_whole(seed, n, dt_s, share):
    """F = F2 F1, B = F2 B1 + B2, Q = F2 Q1 F2' + Q2, however the interval is cut."""
    A, B, density = system(seed, n)
    F, B_d, Q = van_loan(A, B, density, dt_s)
    F1, B1, Q1 = van_loan(A, B, density, dt_s * share)
    F2, B2, Q2 = van_loan(A, B, density, dt_s - dt_s * share)
    assert np.abs(F2 @ F1 - F).max() <= 1e-11 * max(1.0, np.abs(F).max())
    assert np.abs(F2 @ B1 + B2 - B_d).max() <= 1e-11 * max(1.0, np.abs(B_d).max())
    assert np.abs(F2 @ Q1 @ F2.T + Q2 - Q).max() <= 1e-11 * max(1.0, np.abs(Q).max())


def test_noise_is_symmetric_and_semi_definite():
    A, B, density = system(4, 5)
    for dt_s in (1e-6, 1e-3, 1.0):
        Q = van_loan(A, B, density, dt_s)[2]
        assert np.array_equal(Q, Q.T)
        assert np.linalg.eigvalsh(Q)[0] >= -1e-12 * np.trace(Q)


@pytest.mark.parametrize("rate", [1e2, 1e4, 1e6])
def test_a_long_interval_of_a_fast_stable_system_reaches_its_steady_state(rate):
    """exp(-A dt) would be exp(1e9): the doubling never forms it. Steady state: A Q + Q A' + density = 0."""
    A = np.array([[-rate, rate / 3.0], [0.0, -2.0 * rate]])
    B, density = np.array([[rate], [rate]]), np.array([[3.0, 1.0], [1.0, 2.0]]) * rate
    F, B_d, Q = van_loan(A, B, density, 1000.0)
    assert np.abs(F).max() < 1e-30
    assert B_d == pytest.approx(-np.linalg.solve(A, B), rel=1e-9)
    assert pytest.approx(scipy.linalg.solve_continuous_lyapunov(A, -density), rel=1e-9) == Q


@pytest.mark.parametrize("scale", [1e-12, 1e12])
def test_large_and_small_noises_keep_their_digits(scale):
    """A density of 1e12 beside A of order one leaves F untouched."""
    A, B, density = system(9, 4)
    F, B_d, Q = van_loan(A, B, density, 0.3)
    F_s, B_s, Q_s = van_loan(A, B * scale, density * scale, 0.3)
    assert F_s == pytest.approx(F, rel=1e-11, abs=1e-11)
    assert B_s / scale == pytest.approx(B_d, rel=1e-11, abs=1e-11)
    assert Q_s / scale == pytest.approx(Q, rel=1e-11, abs=1e-11)


@given(angle=st.floats(-1e4, 1e4))
@settings(max_examples=60)
def test_a_wrapped_angle_is_the_same_direction(angle):
    wrapped = wrap_angle(angle)
    assert -math.pi <= wrapped < math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-11)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-11)


@pytest.mark.parametrize("turns", [-2, -1, 0, 1, 2])
def test_the_half_turn_belongs_to_the_left(turns):
    assert wrap_angle(math.pi + 2.0 * math.pi * turns) == pytest.approx(-math.pi, abs=1e-14)
