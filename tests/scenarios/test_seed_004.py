"""Seed 004, a first look: where the reference plant's and the constant-velocity plant's filters settle."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from tools.pages import seed_004


@pytest.mark.parametrize("Q", [1.0, 2.3])
def test_the_reference_plant_settles_as_published(Q):
    """Gain, innovation variance and error variance of y, within 60 readings."""
    settled = seed_004.reference_plant(Q)
    digits = 1e-6 if Q == 2.3 else 0.6e-4
    np.testing.assert_allclose(settled.M, seed_004.M_EXPECTED[Q], atol=digits)
    assert pytest.approx(seed_004.S_EXPECTED[Q], abs=5e-6) == settled.S
    assert settled.P[0, 0] == pytest.approx(seed_004.Y_VARIANCE_EXPECTED[Q], abs=1e-6)
    assert settled.steps <= 60


def test_its_covariance_has_the_published_trace():
    assert np.trace(seed_004.reference_plant(2.3).P) == pytest.approx(seed_004.TRACE_EXPECTED, abs=1e-6)


def test_the_constant_velocity_plant_settles_by_its_closed_form():
    """Engine, closed form and Riccati equation agree."""
    alpha, beta, S = seed_004.constant_velocity_closed_form()
    settled = seed_004.constant_velocity()
    np.testing.assert_allclose(settled.M, [alpha, beta], rtol=1e-9)
    assert pytest.approx(S, rel=1e-9) == settled.S
    A, G, H = np.array([[1.0, 0.1], [0.0, 1.0]]), np.array([[0.005], [0.1]]), np.array([[1.0, 0.0]])
    P = solve_discrete_are(A.T, H.T, G @ G.T, np.array([[0.01]]))
    np.testing.assert_allclose(settled.M, P[:, 0] / S, rtol=1e-9)
