"""Scenarios of noise that is not as declared, and of faults that must not hide behind it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fusiond.types import Health, Kind, Verdict
from tests.laws.adaptation_rig import R, adapted, measured, readings_of


def run(z):
    """Reports of one run of configs/noisy_range.toml."""
    return adapted().engine().process(readings_of(z)).copy()


def first(reports, kind, start=0):
    """Readings from `start` to the first report that names this kind, -1 without one."""
    named = np.flatnonzero(reports["fault"][start:, 0] == kind)
    return int(named[0]) + 1 if named.size else -1


def test_a_sensor_that_declares_a_tenth_of_its_sigma_is_believed_as_it_is():
    """NIS is back to its degrees of freedom within 200 readings; at most one reading in a hundred is refused before."""
    # GIVEN noise ten times the declared deviation from the first reading on
    runs = [run(measured(800, 1.0, seed)) for seed in range(6)]

    # THEN from 150 to 200 readings the innovations scatter as expected, and the sensor goes on being used
    nis = np.array([one["nis"] for one in runs])
    assert 0.85 < nis[:, 150:200].mean() < 1.2
    assert 0.9 < nis[:, 200:].mean() < 1.15
    refused = np.array([one["verdict"] == Verdict.GATED for one in runs])
    assert refused[:, :200].mean() < 0.01
    assert refused[:, 200:].mean() < 0.001
    ratio = np.array([one["R_used"][400:, 0] for one in runs]) / R
    assert 70.0 < np.median(ratio) < 140.0


def test_noise_ten_times_as_large_is_named_and_adaptation_is_the_reaction():
    """Named as noise with its factor within 15 readings; R in use follows; the sensor is not excluded."""
    for seed in range(4):
        # WHEN the noise grows tenfold after 300 readings
        reports = run(measured(600, np.repeat([0.1, 1.0], 300), 20 + seed))

        # THEN it is called noise, about ten, and its R is used
        assert 0 < first(reports, Kind.NOISE, 300) <= 15
        named = reports[300 + first(reports, Kind.NOISE, 300)]
        assert 5.0 < named["fault_size"][0] < 20.0
        assert 40.0 < np.median(reports["R_used"][400:, 0]) / R < 200.0
        assert (reports["verdict"][400:] == Verdict.USED).all()


def test_the_end_of_the_noise_is_the_end_of_the_fault():
    reports = run(measured(1200, np.repeat([0.1, 1.0, 0.1], 400), 31))
    assert first(reports, Kind.NOISE, 400) > 0
    assert reports["fault"][-1, 0] == Kind.NONE
    assert 0.5 < np.median(reports["R_used"][1000:, 0]) / R < 2.0


def test_noise_that_falls_slowly_is_over_once_it_has_fallen():
    """Noise back at the declared deviation within a thousand readings raises no alarm of its own; its name goes too."""
    # GIVEN noise that grows tenfold; WHEN it falls by a factor of a hundred in variance over a thousand readings
    std = np.concatenate(
        (np.full(400, 0.1), np.full(300, 1.0), np.geomspace(1.0, 0.1, 1000), np.full(1500, 0.1))
    )
    for seed in range(2):
        reports = run(measured(len(std), std, 60 + seed))

        # THEN it is named while it lasts, and the sensor is healthy again in the end
        assert first(reports, Kind.NOISE, 400) > 0
        assert reports["fault"][900, 0] == Kind.NOISE
        assert (reports["fault"][-500:, 0] == Kind.NONE).all()
        assert (reports["health"][-500:, 0] == Health.HEALTHY).all()


def test_a_sensor_whose_noise_is_not_to_be_estimated_is_weighed_down_once_it_is_named():
    """Told that R of this sensor is as declared, the reaction to noise is that of a run without adaptation."""
    # GIVEN adaptation that leaves this sensor out; WHEN its noise grows tenfold after 300 readings
    design = adapted().design.copy()
    design["noise"]["adapts"] = 0
    for seed in range(2):
        engine = replace(adapted(), design=design).engine()
        reports = engine.process(readings_of(measured(600, np.repeat([0.1, 1.0], 300), 20 + seed))).copy()

        # THEN R in use is as declared until it is named noise, and about a hundred times that from then on
        named = 300 + first(reports, Kind.NOISE, 300)
        assert 300 < named <= 330
        np.testing.assert_allclose(reports["R_used"][:300, 0], R)
        assert 40.0 < np.median(reports["R_used"][400:, 0]) / R < 200.0
        assert np.mean(reports["verdict"][400:] == Verdict.USED) > 0.99


def test_a_step_of_ten_sigma_is_not_taken_for_noise():
    """With adaptation on a bias is found, and not called noise."""
    for seed in range(4):
        z = measured(500, 0.1, 40 + seed)
        z[300:] += 1.0
        reports = run(z)
        kinds = set(reports["fault"][300:, 0].tolist()) - {int(Kind.NONE)}
        assert kinds, seed
        assert int(Kind.NOISE) not in kinds


def test_nothing_is_named_where_nothing_is_wrong():
    for seed in range(3):
        reports = run(measured(3000, 0.1, 60 + seed))
        assert not reports["fault"].any()
