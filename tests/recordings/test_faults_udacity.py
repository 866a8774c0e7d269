"""Laser and radar on a pedestrian, watched: clean as it is, and whichever of the two lies is named."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.types import Health, Kind, Verdict
from tests.recordings.watched import since_s, watched

pytestmark = pytest.mark.recordings("udacity_laser_radar")
KIND = {kind.label: kind for kind in Kind}


@pytest.fixture
def pedestrian(log_of):
    return watched("udacity_laser_radar", log_of("udacity_laser_radar"), {})


def test_a_walk_is_no_fault(pedestrian):
    """25 s of both sensors: nobody is even suspected."""
    reports = pedestrian.run()
    assert not reports["health"].any()
    assert not reports["model"].any()


def test_a_laser_that_is_off_is_named(pedestrian):
    """2 m too much in x and y from 10 s to 15 s: the laser, a bias, within ten of its readings."""
    reports = pedestrian.run("laser.bias=2@10+5")
    assert pedestrian.named(reports) == {("laser", "bias")}
    laser, t_s = pedestrian.sensor("laser"), since_s(reports)
    named = np.isin(reports["health"][:, laser], (Health.FAULTY, Health.EXCLUDED))
    assert 10.0 <= t_s[named][0] < 11.0


def test_one_bad_sample_changes_no_flag(pedestrian):
    """One reading of the laser 2 m (13 std) off in x: the same flags as in the clean run."""
    clean, spiked = pedestrian.run(), pedestrian.run("laser.0.bias=2@10+0.05")
    assert np.array_equal(clean["health"], spiked["health"])


@pytest.mark.parametrize(
    ("fault", "sensor", "kind"),
    [
        ("laser.stuck@10+3", "laser", "stuck"),
        ("laser.nan@10+3", "laser", "garbage"),
        ("laser.noise=10@10+5", "laser", "noise"),
        ("radar.0.bias=3@10+5", "radar", "bias"),
        ("radar.stuck@10+3", "radar", "stuck"),
    ],
)
def test_whoever_lies_is_named_and_the_other_one_leads_on(pedestrian, fault, sensor, kind):
    """Named within 0.5 s, nobody else at fault, within half a metre of the clean run, healthy by 21 s.

    The filter of the radar alone, which begins where a radar is blind, takes nobody's place.
    """
    clean, reports = pedestrian.run(), pedestrian.run(fault)
    named = {name for name, _ in pedestrian.named(reports)}
    assert named == {sensor}
    number, t_s = pedestrian.sensor(sensor), since_s(reports)
    odd = np.flatnonzero(reports["health"][:, number] != Health.HEALTHY)
    assert t_s[odd[0]] < 10.5
    assert t_s[odd[-1]] < 21.0
    assert KIND[kind] in reports["fault"][odd, number]
    at = reports["verdict"] == Verdict.USED
    assert np.max(np.abs(reports["x"][at, :2] - clean["x"][at, :2])) < 0.5
