"""Exact run lengths against the published table, each other and Monte Carlo; the promise from both sides."""

from __future__ import annotations

import math
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fusiond.assembly.design import layout_of
from fusiond.assembly.detection import detection_of
from fusiond.assembly.resolve import resolve
from fusiond.config import parse
from fusiond.faults.thresholds import Promise, whiteness_threshold
from fusiond.numerics import restart, scatter_cusum
from fusiond.numerics.cusum import shift_delay, shift_threshold
from tests.calibration.race import measured_over_promised

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
# average run length: by shift (threshold, worst-case delay)
TABLE = {
    1e3: {0.25: (3.29, 83.4), 0.5: (4.29, 31.1), 1: (5.07, 10.5), 1.5: (5.31, 5.45), 2: (5.33, 3.41), 3: (None, 1.79)},
    1e4: {0.25: (5.47, 152.6), 0.5: (6.56, 49.1), 1: (7.36, 15.1), 1.5: (7.60, 7.49), 2: (7.63, 4.56), 4: (None, 1.46)},
    1e5: {0.25: (7.76, 225.6), 0.5: (8.85, 67.5), 1: (9.66, 19.7), 1.5: (9.91, 9.53), 2: (9.93, 5.71), 5: (None, 1.25)},
    1e6: {0.25: (10.06, 299.2), 0.5: (11.15, 85.9), 1: (11.96, 24.3), 2: (12.23, 6.86), 5: (None, 1.44)},
}  # fmt: skip


def configured(name, without=""):
    text = (CONFIGS / f"{name}.toml").read_text(encoding="utf-8")
    if without:
        text = re.sub(rf"\[sensor\.{without}\].*?(?=\n\[)", "", text, flags=re.DOTALL)
    resolved = resolve(parse(text, name), CONFIGS)
    return resolved, layout_of(resolved)


@cache
def detection(name, interval_s, without="", dead_band=0.0):
    return detection_of(*configured(name, without), Promise(interval_s, dead_band))


@pytest.mark.parametrize(
    ("run", "shift", "h", "delay"),
    [(run, shift, *row) for run, rows in TABLE.items() for shift, row in rows.items()],
)
def test_thresholds_and_delays_are_those_of_the_table(run, shift, h, delay):
    found = shift_threshold(run, shift)
    assert h is None or abs(found - h) <= 0.00501
    digits = len(str(delay).split(".")[1])
    assert abs(shift_delay(found, shift) - delay) <= 0.5 * 10.0**-digits + 1e-9


@pytest.mark.parametrize("shift", [0.25, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("dead_band", [0.0, 0.06])
def test_a_signature_that_never_changes_is_the_ordinary_cusum(shift, dead_band):
    steady = restart.Profile(np.ones(5), np.ones(5), 1)
    for wanted in (1e4, 1e6):
        h = shift_threshold(wanted, shift, dead_band)
        assert restart.run_length([steady], shift, h, dead_band) == pytest.approx(wanted, rel=5e-3)


@pytest.mark.parametrize("age", [8, 16])
def test_a_fading_signature_alarms_as_often_as_its_threshold_says(age):
    """Cycles of a signature that starts anew after `age` readings, one after the other, 4e6 readings."""
    shifts = 1.8 * 0.7 ** np.arange(age)
    h = restart.threshold([restart.Profile(shifts**2, np.ones(age), 0)], 1.0, 2e3)
    rng, cycles = np.random.default_rng(3), 1_500_000
    llr, alive, readings, alarms = np.zeros(cycles), np.ones(cycles, dtype=bool), 0, 0
    for shift in shifts:
        llr[alive] += shift * rng.standard_normal(int(alive.sum())) - 0.5 * shift**2
        readings += int(alive.sum())
        alarms += int(np.sum(llr[alive] >= h))
        alive &= (llr > 0.0) & (llr < h)
    assert readings / alarms == pytest.approx(2e3, rel=3.0 / math.sqrt(alarms))


@pytest.mark.parametrize("ratio", [4.0, 0.25, 1.5, 1.0 / 1.5])
@pytest.mark.parametrize("dof", [1, 3])
def test_the_variance_cusum_alarms_as_often_as_its_threshold_says(ratio, dof):
    """Ten thousand tests side by side; runs until 2000 alarms are seen."""
    h = scatter_cusum.threshold(500.0, scatter_cusum.increment_law(ratio, {dof: 1.0}))
    rng, llr, alarms, readings = np.random.default_rng(5), np.zeros(10_000), 0, 0
    settled = 100  # run lengths are geometric from 0 but for the first few readings, left out
    for k in range(settled + 250):
        square = np.sum(rng.standard_normal((dof, len(llr))) ** 2, axis=0)
        gain = 0.5 * square * (1.0 - 1.0 / ratio) - 0.5 * dof * math.log(ratio)
        llr = np.maximum(0.0, llr + np.minimum(gain, 0.9 * h))
        over = llr >= h
        llr[over] = 0.0
        if k >= settled:
            alarms, readings = alarms + int(over.sum()), readings + len(llr)
    assert readings / alarms == pytest.approx(500.0, rel=3.0 / math.sqrt(alarms) + 0.01)


@pytest.mark.parametrize("dof", [1, 3])
def test_the_whiteness_test_alarms_as_often_as_its_threshold_says(dof):
    h = whiteness_threshold(2000.0, dof)
    rng, alarms, readings = np.random.default_rng(6), 0, 0
    llr, last = np.zeros(10_000), np.zeros((dof, 10_000))
    for k in range(900):
        e = rng.standard_normal(last.shape)
        gain = np.sum(0.3 * e * last - 0.045 * last**2, axis=0)
        last = np.clip(e, -4.0, 4.0)
        llr = np.maximum(0.0, llr + np.minimum(gain, 0.9 * h))
        over = llr >= h
        llr[over] = 0.0
        if k >= 300:
            alarms, readings = alarms + int(over.sum()), readings + len(llr)
    assert readings / alarms == pytest.approx(2000.0, rel=3.0 / math.sqrt(alarms) + 0.08)


@pytest.mark.parametrize(
    ("name", "without", "dead_band", "interval_s", "readings"),
    [
        ("constant_velocity", "", 0.0, 1e3, 3_000_000),
        ("reference_plant", "y2", 0.0, 1e4, 3_000_000),
        ("reference_plant", "", 0.0, 1e4, 5_000_000),
        ("reference_plant", "", 0.06, 1e4, 5_000_000),
        ("wall_robot", "", 0.0, 1e3, 3_000_000),
    ],
)
def test_all_tests_together_keep_the_promise_from_both_sides(name, without, dead_band, interval_s, readings):
    """Measured over promised mean time between false alarms lies in [0.8, 1.5], with three standard deviations."""
    ratio, alarms = measured_over_promised(detection(name, interval_s, without, dead_band), 11, readings)
    spread = 3.0 * ratio / math.sqrt(alarms)
    assert 0.8 - spread <= ratio <= 1.5 + spread
    assert alarms > 150
