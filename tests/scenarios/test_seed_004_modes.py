"""Seed 004's recursions and topologies in the daemon's own engine, each by one configuration key, through replay."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.errors import ConfigError
from tests.laws.seed_004_plant import FIGURES, sharing
from tools.pages.bank_truth import bank, summed
from tools.pages.seed_004_modes import EXACT, PRIOR, plant, ratios, replayed, singular_start
from tools.pages.trials import configured


@pytest.mark.parametrize("recursion", ["ud", "conventional", "information", "seed"])
def test_every_recursion_reaches_the_published_figures_in_sixty_steps(recursion):
    """Gain, innovation variance and error covariance of the reference plant, Q = 2.3, R = 1, from B Q B'."""
    run = replayed(plant((1.0,), recursion=recursion), (1.0,), 60)
    M, digits, _, _, errcov = FIGURES[2.3]
    P = run.P[-1]
    assert P[:, 0] == pytest.approx(M, abs=digits)  # M = P+ C' / R, R = 1
    assert P[0, 0] == pytest.approx(errcov, abs=1e-6)
    assert np.trace(P) == pytest.approx(3.344542, abs=2e-6)


def test_the_seeds_recursion_repairs_its_singular_start_and_ud_has_nothing_to_repair():
    """`repairs` in the summary that replay prints: 0 with ud, one or two with the seed's inverse, never unsound."""
    assert replayed(plant((1.0,)), (1.0,), 20).summary.json_object()["repairs"] == 0
    run = replayed(plant((1.0,), recursion="seed"), (1.0,), 20)
    printed = run.summary.json_object()
    assert printed["repairs"] >= 1
    assert printed["guard"]["repairs"] == printed["repairs"]
    assert printed["guard"]["unsound"] == 0
    assert 0.0 < printed["guard"]["largest"] <= 1.0


def test_model_1_is_repaired_where_rounding_breaks_it():
    """Two all but perfect sensors on one output: (I - M C) P loses definiteness, the guard counts and mends it."""
    R = (1e-15, 1e-15)
    assert replayed(plant(R), R, 40).summary.repairs == 0
    run = replayed(plant(R, recursion="conventional"), R, 40)
    assert run.summary.repairs > 0
    assert run.engine.guard()["unsound"] == 0
    assert np.linalg.eigvalsh(run.P)[:, 0].min() >= -1e-12


@pytest.mark.parametrize(
    ("recursion", "said", "low", "high", "repairs"),
    [
        ("information", {}, 0.0, 1e-12, False),
        ("ud", {}, 0.0, 1e-12, False),
        ("seed", {}, 1e-9, 1e-5, True),
        ("seed", {"seed_diagonal": "deviation"}, 1e-5, 1.0, True),
        ("seed", {"seed_diagonal": "identity_deviation"}, 1e-6, 1e-2, True),
        ("seed", {"seed_diagonal": "identity_variance"}, 1e-4, 1.0, True),
        ("seed", {"guard": "eigen_floor"}, 0.0, 1e-2, True),
    ],
)
def test_what_each_treatment_of_the_singular_start_costs(recursion, said, low, high, repairs):
    """Woodbury and UD need no repair and are exact; the random diagonal errs by what it adds, or by the inverse."""
    start = singular_start(recursion, **said)
    assert low <= start.error <= high
    assert (start.repairs > 0) == repairs


@pytest.mark.parametrize("topology", EXACT[1:])
@pytest.mark.parametrize("R", [(1.0, 25.0), (0.01, 1.0, 100.0)])
def test_exact_topologies_are_the_centralized_filter(topology, R):
    """State to 1e-9 of its deviation, covariance to 1e-9."""
    central, other = replayed(plant(R), R, 60), replayed(plant(R, topology=topology), R, 60)
    s = np.sqrt(np.diagonal(central.engine.covariance()))
    x, x_other = central.engine.track[0]["x"][0], other.engine.track[0]["x"][0]
    assert np.abs((x_other - x) / s).max() <= 1e-9
    apart = other.engine.covariance() - central.engine.covariance()
    assert np.abs(apart / s[:, None] / s).max() <= 1e-9
    assert other.summary.rmse == pytest.approx(central.summary.rmse, rel=1e-2)


@pytest.mark.parametrize("R", [(1.0, 25.0), (0.1, 1.0, 10.0), (0.01, 1.0, 100.0)])
def test_federated_without_reset_loses_nothing_where_sensors_share_their_output(R):
    """Shares proportional to information: trace within 0.2 % of the centralized one, reported as it truly is."""
    found = ratios("federated", R)
    assert found.reported / found.optimal == pytest.approx(1.0, abs=0.002)
    shares = [1.0 / r / sum(1.0 / each for each in R) for r in R]
    known = bank(sharing(R), shares, summed, 151)
    assert found.reported == pytest.approx(float(np.trace(known.true)), rel=0.002)


@pytest.mark.parametrize(
    ("R", "loss", "caution"),
    [
        ((1.0,) * 2, 1.076, 1.26),
        ((1.0,) * 4, 1.314, 1.44),
        ((1.0,) * 10, 1.951, 1.58),
        ((1.0, 100.0), 1.22, 1.27),
        ((0.01, 1.0, 100.0), 8.71, 1.54),
    ],
)
def test_the_averaged_gain_through_replay(R, loss, caution):
    """True over optimal, reported over true, from the record's own honest covariance: within half a percent."""
    found = ratios("seed_averaged", R, 80 if len(R) > 4 else 150)
    assert found.true is not None
    assert found.true / found.optimal == pytest.approx(loss, rel=0.005)
    assert found.reported / found.true == pytest.approx(caution, rel=0.005)


def test_covariance_intersection_is_never_surer_than_the_optimum():
    found = ratios("covariance_intersection", (1.0, 25.0))
    assert found.reported >= found.optimal


def test_errors_keep_to_the_honest_covariance_and_not_to_the_reported_one():
    """NEES of the averaged gain over 1500 steps: its report is too cautious, so the mean is clearly below 3."""
    R = (1.0,) * 4
    averaged = replayed(plant(R, topology="seed_averaged"), R, 1500, seed=3).summary
    optimal = replayed(plant(R, topology="stacked"), R, 1500, seed=3).summary
    assert averaged.nees_mean is not None
    assert optimal.nees_mean is not None
    assert averaged.nees_mean < 2.5
    assert optimal.nees_mean == pytest.approx(3.0, abs=0.4)


@pytest.mark.parametrize(
    ("initial", "said"),
    [
        ({"std": {"x1": 1.0, "x2": 1.0, "x3": 1.0}, "covariance": PRIOR}, "has std and covariance"),
        ({"std": None, "covariance": [[1.0]]}, "is not 3 x 3"),
        (
            {"std": None, "covariance": [[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]]},
            "positive semi-definite",
        ),
        ({"std": None, "covariance": [[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]}, "symmetric"),
    ],
)
def test_a_start_that_is_no_covariance_is_refused(initial, said):
    with pytest.raises(ConfigError, match=said):
        configured("reference_plant", {"initial": initial})
