"""Every simulated system is exactly as sure of itself as it may be: NEES, NIS and whiteness, two-sided at 95 %.

The runs are the seeds from 1000 on. A consistent filter leaves a 95 % band with one set of seeds in twenty, for no
fault of its own (the seeds 0 to 99 do so for `reference_plant`, whose noise happens to have a variance of 1.04 there);
so the last test asks how often it does, over 40 sets.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import binom

from tools.pages.consistency import CASES, Ensemble, ensemble, mean_of_squares, simulations, whiteness
from tools.pages.trials import configured

RUNS = 200
FIRST_SEED = 1000
UPDATING = {
    "minicar": ["ultrasonic"],
    "birotor": ["ultrasonic"],
    "wall_robot": ["range"],
    "reference_plant": ["y1", "y2"],
    "constant_velocity": ["y1"],
    "planar": ["gps", "wheel_speed", "gyro", "heading", "beacon", "radar"],
}
EACH = [(name, sensor) for name, sensors in UPDATING.items() for sensor in sensors]

logs = cache(lambda name, runs=RUNS: simulations(CASES[name], runs, FIRST_SEED))
consistent = cache(lambda name: ensemble(CASES[name], logs(name)))


@cache
def with_wrong_noise(name: str, variance_factor: float, sensors: tuple[str, ...]) -> Ensemble:
    """The same logs through a filter that takes these sensors' R for `variance_factor` times what it is."""
    said = configured(name).config.sensor
    factor = variance_factor**0.5
    changes = {
        sensor: {"noise_std": {key: std * factor for key, std in said[sensor].noise_std.items()}}
        for sensor in sensors
    }
    return ensemble(CASES[name], logs(name), {"sensor": changes})


def test_every_simulated_system_is_here():
    assert set(UPDATING) == set(CASES)
    for name, sensors in UPDATING.items():
        assert set(consistent(name).whitened) == set(sensors)


@pytest.mark.parametrize("name", CASES)
def test_nees_is_in_its_band(name):
    """Over 200 independent runs at the last stamp of each."""
    check = consistent(name).nees_check()
    assert check.inside, check


@pytest.mark.parametrize(("name", "sensor"), EACH)
def test_nis_is_in_its_band(name, sensor):
    """Over all readings of 200 runs: 1 % to 4 % wide."""
    check = consistent(name).nis_check(sensor)
    assert check.inside, check


@pytest.mark.parametrize("name", CASES)
def test_whitened_innovations_are_white(name):
    """All sensors together in the order processed, ten lags: nothing is left to learn from the last readings."""
    check = consistent(name).whiteness_check()
    assert check.inside, check


@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize(("name", "sensor"), EACH)
def test_a_wrong_noise_is_outside(name, sensor, factor):
    """Twice or half the variance of one sensor moves its NIS out of the band, to the side it must."""
    check = with_wrong_noise(name, factor, (sensor,)).nis_check(sensor)
    assert check.value > check.high if factor < 1.0 else check.value < check.low, check


@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize("name", CASES)
def test_a_wrong_noise_of_every_sensor_is_outside_for_nees_too(name, factor):
    check = with_wrong_noise(name, factor, tuple(UPDATING[name])).nees_check()
    assert check.value > check.high if factor < 1.0 else check.value < check.low, check


def test_the_printed_seed_001_is_neither_consistent_nor_white():
    """Its off-by-one moves NIS and whiteness far outside, though gain and variance are right."""
    printed = ensemble(replace(CASES["wall_robot"], config="wall_robot_as_written"), logs("wall_robot"))
    assert printed.nis_check("range").value > printed.nis_check("range").high
    assert printed.whiteness_check().value > 5.0 * printed.whiteness_check().high


@pytest.mark.parametrize("name", ["wall_robot", "reference_plant", "constant_velocity"])
def test_95_of_100_sets_of_seeds_are_in_the_band(name):
    """40 sets of 25 runs: as many inside as a coin of 95 % gives, but for one case in a thousand."""
    runs = logs(name, 1000)
    sets = [ensemble(CASES[name], runs[at : at + 25]) for at in range(0, 1000, 25)]
    least = binom.ppf(1e-3, len(sets), 0.95)
    assert sum(one.nees_check().inside for one in sets) >= least
    assert sum(one.nis_check(UPDATING[name][0]).inside for one in sets) >= least


def test_the_bands_are_the_textbook_s():
    """n = 2 and n = 3 states, 100 runs: [1.63, 2.41] and [2.54, 3.50]."""
    two, three = mean_of_squares(200.0, 200, 2), mean_of_squares(300.0, 300, 3)
    assert (two.value, round(two.low, 2), round(two.high, 2)) == (2.0, 1.63, 2.41)
    assert (three.value, round(three.low, 2), round(three.high, 2)) == (3.0, 2.54, 3.50)


def test_the_test_of_whiteness_has_the_level_it_says():
    """On white noise it is above its 95 % limit in 5 % of 1000 draws, within the binomial's 99.9 %."""
    rng = np.random.default_rng(5)
    limit = 18.307  # chi-square, 10 degrees, 95 %
    alarms = sum(whiteness([rng.standard_normal(100) for _ in range(5)], 10) > limit for _ in range(1000))
    assert binom.ppf(5e-4, 1000, 0.05) <= alarms <= binom.ppf(1.0 - 5e-4, 1000, 0.05)
