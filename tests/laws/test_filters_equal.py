"""Seed 004's recursions: Model 1, Model 2 and UD are one filter, and reach the published figures of its plant."""

from __future__ import annotations

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from fusiond.filters import conventional, information, joseph, ud
from fusiond.filters.innovation import Innovation, right_divide
from fusiond.numerics.covariance import repair
from tests.laws.seed_004_plant import FIGURES, ONE, A, B, C, noise

UPDATES = {
    "conventional": conventional.update,
    "joseph": joseph.update,
    "information": information.update,
    "ud": ud.update,
}
SEEDS = st.integers(0, 10**9)


def random_case(seed, rank_missing=0):
    """x, P of the given rank, and an innovation of one to three correlated channels."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 6)), int(rng.integers(1, 4))
    root = rng.standard_normal((n, max(n - rank_missing, 0)))
    noise_root = rng.standard_normal((m, m))
    R = noise_root @ noise_root.T + 0.05 * np.eye(m)
    seen = Innovation(rng.standard_normal(m), rng.standard_normal((m, n)), R)
    return rng.standard_normal(n), root @ root.T, seen


@given(seed=SEEDS, missing=st.integers(0, 3))
@settings(max_examples=80)
def test_all_recursions_are_one_filter(seed, missing):
    """From any prior, singular ones included."""
    x, P, seen = random_case(seed, missing)
    x_1, P_1 = joseph.update(x, P, seen)
    scale = max(1.0, np.abs(P).max())
    for name, update in UPDATES.items():
        x_2, P_2 = update(x, P, seen)
        assert x_2 == pytest.approx(x_1, abs=1e-9 * scale), name
        assert pytest.approx(P_1, abs=1e-9 * scale) == P_2, name


@given(seed=SEEDS)
@settings(max_examples=40)
def test_model_2_as_printed_is_model_1_where_the_prior_has_an_inverse(seed):
    x, P, seen = random_case(seed)
    P = P + 0.1 * np.eye(len(x))
    for mine, theirs in zip(
        information.update_by_inverse(x, P, seen), conventional.update(x, P, seen), strict=True
    ):
        assert mine == pytest.approx(theirs, abs=1e-9)


@given(seed=SEEDS)
@settings(max_examples=20)
def test_the_conventional_filter_is_filterpys(seed):
    x, P, seen = random_case(seed)
    kf = KalmanFilter(dim_x=len(x), dim_z=len(seen.nu))
    kf.x, kf.P = x[:, None], P
    kf.update(seen.nu[:, None] + seen.H @ x[:, None], R=seen.R, H=seen.H)
    x_1, P_1 = conventional.update(x, P, seen)
    assert x_1 == pytest.approx(kf.x[:, 0], abs=1e-9)
    assert pytest.approx(kf.P, abs=1e-9) == P_1


@given(seed=SEEDS, missing=st.integers(0, 2))
@settings(max_examples=30)
def test_information_of_several_readings_adds_up_to_one_stacked_update(seed, missing):
    """Also where one of them is perfect and has no information form."""
    x, P, seen = random_case(seed, missing)
    rng = np.random.default_rng(seed + 1)
    perfect = Innovation(rng.standard_normal(1), rng.standard_normal((1, len(x))), np.zeros((1, 1)))
    H, R = np.vstack([seen.H, perfect.H]), np.zeros((len(seen.nu) + 1,) * 2)
    R[:-1, :-1] = seen.R
    x_1, P_1 = joseph.update(x, P, Innovation(np.append(seen.nu, perfect.nu), H, R))
    if np.linalg.cond(H @ P @ H.T + R) < 1e6:
        x_2, P_2 = information.update_together(x, P, [perfect, seen])
        assert x_2 == pytest.approx(x_1, abs=1e-7)
        assert pytest.approx(P_1, abs=1e-7) == P_2


@pytest.mark.parametrize("name", ["conventional", "information", "ud"])
def test_a_perfect_reading_is_believed(name):
    """R = 0: Model 2 has no R^-1 then and takes the Joseph update."""
    seen = Innovation(np.array([0.4]), np.array([[1.0, 0.0]]), np.zeros((1, 1)))
    x, P = UPDATES[name](np.zeros(2), np.array([[2.0, 1.0], [1.0, 1.0]]), seen)
    assert x == pytest.approx([0.4, 0.2], abs=1e-15)
    assert pytest.approx(np.array([[0.0, 0.0], [0.0, 0.5]]), abs=1e-15) == P
    again, P_again = UPDATES[name](x, P, Innovation(np.array([0.0]), seen.H, seen.R))
    assert again == pytest.approx(x, abs=1e-12)
    assert pytest.approx(P, abs=1e-12) == P_again


def history(update, Q, R=1.0, steps=100):
    """Model on the reference plant from the seed's prior B Q B' (2-1): M, S, P+ and x+ of every step."""
    rng = np.random.default_rng(4)
    x, P, rows = np.zeros(3), noise(Q), []
    for k in range(1, steps + 1):
        seen = Innovation(rng.standard_normal(1) - C @ x, C, R * ONE)
        S = float((C @ P @ C.T)[0, 0] + R)
        x, P = update(x, P, seen)
        rows.append((P @ C.T / R, S, P, x))
        x, P = A @ x + B[:, 0] * np.sin(k / 5.0), conventional.predict(P, A, noise(Q))
    return rows


@pytest.mark.parametrize("Q", FIGURES)
@pytest.mark.parametrize("name", UPDATES)
def test_the_reference_plant_reaches_its_published_figures(name, Q):
    """Gain, innovation variance and error covariance (2-9, 3-8) within 60 steps."""
    M_expected, M_digits, S_expected, S_digits, errcov = FIGURES[Q]
    rows = history(UPDATES[name], Q)
    M, S, P, _ = rows[59]
    assert M[:, 0] == pytest.approx(M_expected, abs=M_digits)
    assert pytest.approx(S_expected, abs=S_digits) == S
    assert float((C @ P @ C.T)[0, 0]) == pytest.approx(errcov, abs=1e-6)
    settled = rows[-1]
    assert pytest.approx(settled[0], abs=1e-6) == M
    assert settled[1] == pytest.approx(S, abs=1e-6)


def test_the_table_of_the_larger_noise_has_its_trace():
    assert np.trace(history(conventional.update, 2.3)[-1][2]) == pytest.approx(3.344542, abs=1e-6)


@pytest.mark.parametrize("Q", FIGURES)
def test_both_models_agree_to_1e_12_from_the_singular_start(Q):
    """Model 2 in the Woodbury form needs no repair: 4.4e-16 over 100 steps."""
    for (_, _, P_1, x_1), (_, _, P_2, x_2) in zip(
        history(conventional.update, Q), history(information.update, Q), strict=True
    ):
        assert np.abs(P_1 - P_2).max() <= 1e-12
        assert np.abs(x_1 - x_2).max() <= 1e-12


def test_the_prior_is_singular_for_two_steps():
    """Equation 2-1's B Q B' has rank 1; each step adds one: the singularity is built in."""
    P, ranks = noise(2.3), []
    for _ in range(3):
        ranks.append(np.linalg.matrix_rank(P))
        _, P = conventional.update(np.zeros(3), P, Innovation(np.zeros(1), C, ONE))
        P = conventional.predict(P, A, noise(2.3))
    assert ranks == [1, 2, 3]


def repaired_history(deviation, seed, steps=100):
    """Model 2 as printed, singular priors repaired by |N(0, deviation^2)|; largest error of P+ over the run."""
    rng = np.random.default_rng(seed)
    P, exact, worst, repairs = noise(2.3), history(conventional.update, 2.3, steps=steps), 0.0, 0
    for _, _, P_exact, _ in exact:
        if np.linalg.matrix_rank(P) < 3:
            P = repair(
                P, "seed", before=P, diagonal=np.abs(deviation * rng.standard_normal(3)), regular=True
            ).P
            repairs += 1
        _, P = information.update_by_inverse(np.zeros(3), P, Innovation(np.zeros(1), C, ONE))
        worst = max(worst, np.abs(P - P_exact).max())
        P = conventional.predict(P, A, noise(2.3))
    return worst, repairs


@pytest.mark.parametrize(
    ("deviation", "low", "high"),
    [(1e-7, 1e-9, 1e-6), (1e-14, 1e-5, 1.0), (1e-4, 1e-6, 1e-3), (1e-2, 1e-4, 0.1)],
)
def test_the_seeds_repair_costs_what_its_reading_says(deviation, low, high):
    """Four readings of figure 3-1: the error is of the size of what is added, or of an inverse at condition 1e16."""
    worst = [repaired_history(deviation, seed, 30) for seed in range(10)]
    assert low < np.median([error for error, _ in worst]) < high
    assert all(repairs >= 1 for _, repairs in worst)


def test_right_division_solves_and_survives_a_singular_divisor():
    M, S = np.array([[1.0, 2.0]]), np.array([[2.0, 0.5], [0.5, 1.0]])
    assert right_divide(M, S) @ S == pytest.approx(M)
    assert right_divide(np.array([[2.0, 2.0]]), np.ones((2, 2))) == pytest.approx(np.array([[1.0, 1.0]]))
