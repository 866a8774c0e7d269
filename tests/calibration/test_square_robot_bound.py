"""Seed 003's filter on its own model: as near to the posterior Cramer-Rao bound as it may be, and honest about it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from tools.pages.seed_003 import CONFIGS
from tools.pages.seed_003_bound import score
from tools.pages.trials import configured

RUNS = 16
REACH = 1.05


@pytest.mark.parametrize("config", CONFIGS)
def test_errors_are_within_5_percent_of_the_bound(config):
    """Every state, against the errors that attain the bound on the same draws; and the NEES in its 99 % band."""
    assembly = configured(config)
    found = score(assembly, assembly.engine(), RUNS, seed=500)
    assert found.paired.max() <= REACH
    # those that are fresh every few milliseconds need no pairing
    fresh = [found.names.index(name) for name in ("speed", "wheel_turning", "push_slip")]
    assert np.abs(found.ratio[fresh] - 1.0) == pytest.approx(
        np.zeros(3), abs=4.0 * found.ratio_std[fresh].max()
    )
    degrees = RUNS * len(found.names)
    assert chi2.ppf(0.005, degrees) < found.nees.sum() < chi2.ppf(0.995, degrees)


def test_a_filter_told_wrong_noise_is_found_out():
    """Told ten times the encoders' noise, the speed misses the bound by more than 5 %: the measure can fail."""
    wrong = {"sensor": {"encoders": {"noise_std": {"left_m_s": 0.02, "right_m_s": 0.02}}}}
    missed = score(configured("square_robot"), configured("square_robot", wrong).engine(), 3, seed=700)
    assert missed.of("speed") > REACH
