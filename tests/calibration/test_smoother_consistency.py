"""Smoothed states are as sure of themselves as they may be, and nearer to the truth than the filter's.

NEES is taken at the middle of each of 100 independent runs, its band two-sided; the seeds are those of
test_consistency.py.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from tools.pages.consistency import CASES, simulations
from tools.pages.smoothing import gain_on
from tools.pages.smoothing_rows import simulated_table

FIRST_SEED = 1000
LINEAR = ["minicar", "reference_plant", "constant_velocity"]


@cache
def gain(name: str, runs: int = 100):
    return gain_on(CASES[name], simulations(CASES[name], runs, FIRST_SEED))[1]


@pytest.mark.parametrize("name", LINEAR)
def test_nees_of_the_smoothed_is_in_its_band(name):
    assert gain(name).nees.inside, gain(name).nees


@pytest.mark.parametrize("name", LINEAR)
def test_every_error_is_smaller_than_the_filters(name):
    """RMSE over all updates of all runs, state by state."""
    assert np.all(gain(name).ratio < 1.0), gain(name).ratio


@pytest.mark.parametrize("factor", [0.4, 2.5])
def test_a_wrong_noise_is_outside(factor):
    """A sensor taken for 2.5 times as noisy as it is, in variance, or as little: above or below the band."""
    case = CASES["constant_velocity"]
    wrong = replace(case, changes={"sensor": {"y1": {"noise_std": {"y": 0.1 * factor**0.5}}}})
    nees = gain_on(wrong, simulations(case, 100, FIRST_SEED))[1].nees
    assert nees.value > nees.high if factor < 1.0 else nees.value < nees.low, nees


def test_the_page_says_what_is_measured_now():
    """Two of its rows, digit by digit; `python -m tools.pages.smoothing_page` writes it anew."""
    page = (Path(__file__).resolve().parents[2] / "docs" / "smoothing.md").read_text(encoding="utf-8")
    for row in simulated_table(["constant_velocity", "minicar"]).splitlines():
        assert row in page
    assert "**no**" not in page
