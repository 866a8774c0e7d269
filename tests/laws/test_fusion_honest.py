"""What the fused covariances are worth: against the joint error covariance of the whole bank, by other algebra."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fusiond.filters import conventional
from fusiond.filters.innovation import Innovation
from fusiond.fusion.centralized import update_averaged
from fusiond.fusion.covariance_intersection import intersect, weights
from fusiond.fusion.federated import shares
from tests.laws.seed_004_plant import ONE, A, C, noise, random_plant, sharing
from tools.pages.bank_truth import System, averaged, bank, summed

CV = System(
    np.array([[1.0, 0.1], [0.0, 1.0]]),
    np.array([[0.005], [0.1]]) @ np.array([[0.005, 0.1]]),
    (np.array([[1.0, 0.0]]),) * 2,
    (0.01 * ONE, 0.01 * ONE),
    np.eye(2),
)


def heard_with(system, R):
    return System(
        system.A, system.Q, (system.C[0],) * len(R), tuple(r * ONE for r in R), np.eye(len(system.A))
    )


def by_information(system):
    """Shares from the sensors' information with the centralized prediction, as assembly takes them."""
    P = system.P0
    for _ in range(60):
        for H, R in zip(system.C, system.R, strict=True):
            M = np.linalg.solve(H @ P @ H.T + R, H @ P).T
            P = P - M @ H @ P
        P = system.A @ P @ system.A.T + system.Q
    return shares(
        [float(np.trace(np.linalg.solve(R, H @ P @ H.T))) for H, R in zip(system.C, system.R, strict=True)]
    )


def intersected(covariances):
    """Weights W_i and covariance of the intersection, for the joint algebra."""
    Y = np.linalg.inv(np.array(covariances))
    w = weights(Y)
    P = np.linalg.inv(np.tensordot(w, Y, 1))
    return [share * P @ each for share, each in zip(w, Y, strict=True)], P


@pytest.mark.parametrize("R", [(1.0, 1.0), (1.0, 25.0), (0.1, 1.0, 10.0), (0.01, 1.0, 100.0)])
@pytest.mark.parametrize("plant", ["reference", "constant velocity"])
def test_federated_without_reset_is_centralized_where_sensors_share_their_output(plant, R):
    """Shares proportional to information: 1.000 +- 0.002 in true and in reported covariance, unequal R included."""
    system = heard_with(sharing(R) if plant == "reference" else CV, R)
    known = bank(system, by_information(system), summed, 400)
    assert known.loss == pytest.approx(1.0, abs=0.002)
    assert known.caution == pytest.approx(1.0, abs=0.002)


@given(seed=st.integers(0, 10**9), sensors=st.integers(2, 4))
@settings(max_examples=40)
def test_federated_without_reset_is_never_optimistic(seed, sensors):
    """Any stable plant, sensors that see different things: reported - true has no negative eigenvalue."""
    system = random_plant(seed, sensors)
    known = bank(system, by_information(system), summed, 120)
    gap = np.linalg.eigvalsh(known.reported - known.true)
    assert gap[0] >= -1e-9 * np.trace(known.reported)
    assert known.loss >= 1.0 - 1e-9


def test_what_it_costs_where_sensors_see_different_things():
    """Twenty random four-state plants, three sensors of like noise: the median loses a few percent of tr P."""
    losses = [bank(system, by_information(system), summed, 200).loss for system in map(alike, range(20))]
    assert min(losses) >= 1.0
    assert np.median(losses) <= 1.10


def alike(seed):
    return random_plant(seed, 3, decades=0.0)


@given(seed=st.integers(0, 10**9))
@settings(max_examples=30)
def test_covariance_intersection_is_never_optimistic(seed):
    """Two or three local filters that share all of their process noise."""
    system = random_plant(seed, 2 + seed % 2)
    count = len(system.C)
    known = bank(system, (1.0,) * count, intersected, 120)
    gap = np.linalg.eigvalsh(known.reported - known.true)
    assert gap[0] >= -1e-9 * np.trace(known.reported)


def test_the_naive_sum_of_whole_filters_is_optimistic():
    """Why no topology offers it: locals with whole Q and P0, added up, report 0.63 and 0.46 of their true variance."""
    for R, expected in (((1.0,) * 2, 0.63), ((1.0,) * 3, 0.46)):
        known = bank(sharing(R), (1.0,) * len(R), summed, 200)
        assert known.caution == pytest.approx(expected, abs=0.01)


@given(seed=st.integers(0, 10**9))
@settings(max_examples=40)
def test_an_intersection_covers_any_correlation(seed):
    """Two estimates with errors correlated at random: reported covers the true covariance of the fused estimate."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((6, 6))
    J = root @ root.T + 0.01 * np.eye(6)
    locals_ = [J[:3, :3], J[3:, 3:]]
    W, _ = intersected(locals_)
    x, P = intersect([(np.zeros(3), locals_[0]), (np.ones(3), locals_[1])])
    true = np.hstack(W) @ J @ np.hstack(W).T
    assert np.linalg.eigvalsh(P - true)[0] >= -1e-6 * np.trace(P)
    assert x == pytest.approx(W[1] @ np.ones(3), abs=1e-4 * np.abs(x).max() + 1e-9)
    assert np.linalg.slogdet(P)[1] <= min(np.linalg.slogdet(each)[1] for each in locals_) + 1e-2


def test_intersection_weights_do_not_depend_on_units():
    rng = np.random.default_rng(3)
    roots = rng.standard_normal((3, 4, 4))
    estimates = [(rng.standard_normal(4), root @ root.T) for root in roots]
    units = 10.0 ** np.array([-9.0, 0.0, 3.0, 9.0])
    x, P = intersect(estimates)
    x_2, P_2 = intersect([(x_i * units, P_i * units[:, None] * units) for x_i, P_i in estimates])
    assert x_2 / units == pytest.approx(x, rel=1e-6)
    assert P_2 / units[:, None] / units == pytest.approx(P, rel=1e-6)


@pytest.mark.parametrize(
    ("estimates", "expected"),
    [
        ([(np.ones(2), np.zeros((2, 2)))] * 2, np.zeros((2, 2))),
        ([(np.ones(2), np.diag([1.0, 0.0]))] * 2, np.diag([1.0, 0.0])),
        ([(np.ones(2), np.diag([1.0, 0.0])), (np.ones(2), np.eye(2))], np.diag([1.0, 0.0])),
    ],
)
def test_singular_estimates_intersect(estimates, expected):
    """The seed's start: nothing to gain where all agree, and the surer one where only one is perfect."""
    x, P = intersect(estimates)
    assert x == pytest.approx(np.ones(2))
    assert pytest.approx(expected, abs=1e-9) == P


TABLE = [
    ((1.0,) * 2, 1.076, 1.26), ((1.0,) * 4, 1.314, 1.44), ((1.0,) * 10, 1.951, 1.58),
    ((1.0, 100.0), 1.22, 1.27), ((0.01, 1.0, 100.0), 8.71, 1.54),
]  # fmt: skip


@pytest.mark.parametrize(("R", "loss", "caution"), TABLE)
def test_the_averaged_gain_is_neither_optimal_nor_truly_reported(R, loss, caution):
    """tr true / optimal and reported / true on the reference plant, Q = 2.3, within half a percent of the table."""
    known = averaged(sharing(R), 300)
    assert known.loss == pytest.approx(loss, rel=0.005)
    assert known.caution == pytest.approx(caution, rel=0.005)


def test_its_report_does_not_shrink_with_more_sensors():
    """Ten equal sensors report the covariance of one."""
    assert np.trace(averaged(sharing((1.0,) * 10), 300).reported) == pytest.approx(3.344542, abs=1e-5)


def test_it_diverges_on_an_unstable_plant():
    """a = 1.5, R = {0.01, 1e6}: a^2 (1 - 1/N) > 1, so P of (5-6) grows until the junk sensor's gain is large enough
    to hold it, and by then that gain injects its noise: 5557 for an optimum of 0.0099."""
    system = System(1.5 * ONE, ONE, (ONE, ONE), (0.01 * ONE, 1e6 * ONE), ONE)
    growing = [averaged(system, steps).loss for steps in (20, 40, 60, 80, 100)]
    assert all(later > 1.3 * earlier for earlier, later in itertools.pairwise(growing))
    known = averaged(system, 400)
    assert float(known.optimal[0, 0]) == pytest.approx(0.0099, rel=0.005)
    assert float(known.true[0, 0]) == pytest.approx(5557.0, rel=0.005)
    assert known.loss == pytest.approx(5.6e5, rel=0.01)


@pytest.mark.parametrize(("sensors", "loss"), [(2, 40.0), (4, 3.4e5)])
def test_a_milder_plant_pays_dearly_too(sensors, loss):
    """a = 1.2: two sensors stay bounded at 40 times the optimum, four end at 3e5."""
    junk = (1e6 * ONE,) * (sensors - 1)
    system = System(1.2 * ONE, ONE, (ONE,) * sensors, (0.01 * ONE, *junk), ONE)
    assert averaged(system, 2000).loss == pytest.approx(loss, rel=0.01)


@given(seed=st.integers(0, 10**9), sensors=st.integers(1, 4))
@settings(max_examples=30)
def test_the_honest_covariance_is_the_one_of_other_algebra(seed, sensors):
    """update_averaged's honest P against the bank's own recursion, and equation 5-6 beside it."""
    system = random_plant(seed, sensors)
    known = averaged(system, 12)
    P = honest = system.P0
    for step in range(12):
        if step:
            P = conventional.predict(P, system.A, system.Q)
            honest = conventional.predict(honest, system.A, system.Q)
        parts = [Innovation(np.zeros(len(H)), H, R) for H, R in zip(system.C, system.R, strict=True)]
        outcome = update_averaged(np.zeros(4), P, honest, parts)
        P, honest = outcome.P, outcome.honest
    scale = np.trace(known.true)
    assert pytest.approx(known.reported, abs=1e-9 * scale) == P
    assert honest == pytest.approx(known.true, abs=1e-9 * scale)


def test_with_one_sensor_the_average_is_model_1():
    """N = 1: (5-4) to (5-6) are (2-4) to (2-7), and honest equals reported."""
    seen = Innovation(np.array([0.7]), C, ONE)
    outcome = update_averaged(np.zeros(3), noise(2.3), noise(2.3), [seen])
    x, P = conventional.update(np.zeros(3), noise(2.3), seen)
    assert outcome.x == pytest.approx(x, abs=1e-15)
    assert pytest.approx(P, abs=1e-15) == outcome.P
    assert outcome.honest == pytest.approx(P, abs=1e-14)


def test_the_averaged_gain_is_naive_averaging_of_one_sensor_filters():
    """Two equal sensors: each filter alone, their estimates averaged, has the same true covariance."""
    system = sharing((1.0, 1.0))
    halves = bank(system, (1.0, 1.0), lambda P: ([0.5 * np.eye(3)] * 2, P[0]), 300)
    assert np.trace(halves.true) == pytest.approx(np.trace(averaged(system, 300).true), rel=1e-9)


def test_a_case_of_three_different_states():
    """A sensor for each state, R = 1: each is heard at a third; tr true / optimal as measured in docs/seed_004.md."""
    rows = tuple(np.eye(3)[[i]] for i in range(3))
    known = averaged(System(A, noise(2.3), rows, (ONE,) * 3, noise(2.3)), 300)
    assert known.loss == pytest.approx(1.82, rel=0.005)
    assert known.caution == pytest.approx(1.66, rel=0.005)
