"""The strapdown filter is exactly as sure of itself as it may be: NEES and NIS over flights, two-sided at 95 %.

The flights are those of fusiond.simulation.flight, which integrates nothing but the noise and shares no line with the
model; 20 s each, seeds from 1000 on. NEES is that of the 15 errors, the attitude's about the local axes.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from fusiond.models import strapdown
from fusiond.numerics.kernel import interpreted
from fusiond.simulation.flight import START_STD, flight, nominal_start
from tools.pages.consistency import Ensemble
from tools.pages.trials import configured, records

RUNS = 100
FIRST_SEED = 1000
DURATION_NS = 20 * 10**9
AIDING = ["barometer", "gnss_position", "gnss_velocity", "magnetometer"]
ONE_FILTER = {"leave_one_out": False, "local_filters": False}


@cache
def simulated(layout):
    """Readings of every flight in order of time, and its truth at the end."""
    runs = []
    for seed in range(FIRST_SEED, FIRST_SEED + RUNS):
        readings, truth = flight(seed, DURATION_NS)
        end = np.append(truth.values[-1], np.zeros(3))
        runs.append((records(layout, sorted(readings, key=lambda reading: reading.t_ns)), end))
    return runs


@cache
def flown(variance_factor=1.0):
    """All flights through a filter that takes every sensor's variance for `variance_factor` times what it is."""
    said = configured("flight").config.sensor
    factor = variance_factor**0.5
    changes = {
        name: {"noise_std": {key: std * factor for key, std in section.noise_std.items()}}
        for name, section in said.items()
    }
    assembly = configured("flight", {"sensor": changes, "filter": ONE_FILTER})
    engine, p = assembly.engine(), np.array(assembly.resolved.process.parameters)
    numbers = assembly.layout.numbers
    nees, whitened, error = [], {name: [] for name in AIDING}, np.zeros(15)
    for readings, end in simulated(assembly.layout):
        engine.reset()
        reports = engine.process(readings)
        interpreted(strapdown.error_between)(reports["x"][-1], end, p, error)
        nees.append(error @ np.linalg.solve(engine.covariance(), error))
        for name in AIDING:
            mine = reports[reports["sensor"] == numbers[name]]
            whitened[name].append(mine["e"][:, : mine["dof"][0]].copy())
    return Ensemble(15, np.array(nees), whitened, [])


def test_the_configuration_says_what_the_simulator_draws_from():
    """Start and its deviations, number for number."""
    assembly = configured("flight")
    assert dict(assembly.config.initial.state) == pytest.approx(nominal_start())
    stds = [assembly.config.initial.std[slot.key] for slot in assembly.layout.errors]
    assert stds == START_STD.tolist()


def test_nees_is_in_its_band():
    """15 errors at the end of 100 flights."""
    check = flown().nees_check()
    assert check.inside, check


@pytest.mark.parametrize("sensor", AIDING)
def test_nis_is_in_its_band(sensor):
    check = flown().nis_check(sensor)
    assert check.inside, check


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_wrong_noises_are_outside(factor):
    """Half or twice the variance of every sensor, the IMU too, moves NEES and every NIS to the side it must."""
    wrong = flown(factor)
    for check in (wrong.nees_check(), *(wrong.nis_check(name) for name in AIDING)):
        assert check.value > check.high if factor < 1.0 else check.value < check.low, check
