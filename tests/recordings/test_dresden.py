"""A drive through Dresden: fixes that repeat themselves, a logger that stalls, and three outages."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from fusiond.assembly.assembly import assemble
from fusiond.errors import ConfigError
from fusiond.recording.importing.mapping import read_mapping
from fusiond.types import Verdict
from tools.pages.recorded import CONFIGS, fix_residuals_m, outage_m, recorded

pytestmark = pytest.mark.recordings("dresden_car")
REFERENCE_RMS_M = 4.40
REFERENCE_OUTAGES_M = {(60.0, 70.0): 3.9, (60.0, 90.0): 9.3, (100.0, 130.0): 9.5}
"""A plain extended filter with constant turn rate and velocity, which counts rows instead of reading stamps."""


@pytest.fixture
def dresden(log_of):
    return recorded("dresden_car", log_of("dresden_car"))


def test_the_estimate_follows_the_fixes(dresden):
    """RMS distance to the 2,117 new fixes no worse than the reference's 4.40 m."""
    assert np.sqrt(np.mean(fix_residuals_m(dresden) ** 2)) <= REFERENCE_RMS_M


@pytest.mark.parametrize(("outage", "reach_m"), REFERENCE_OUTAGES_M.items())
def test_an_outage_ends_no_further_off_than_the_reference(dresden, outage, reach_m):
    """Fixes withheld for 10 s and 30 s: the last of them is 3.9, 9.3 and 9.5 m away at most."""
    assert outage_m(dresden, *outage) <= reach_m


def test_repeated_fixes_are_no_fresh_evidence(dresden):
    """2,117 new positions in 10,800 rows; every other row is refused as held, and none for another reason."""
    gps = dresden.run().sensors["gps"]
    assert gps.verdicts == {Verdict.USED.label: 2117, Verdict.HELD.label: 10_800 - 2117}


def test_counting_repeats_as_evidence_would_be_overconfident(dresden):
    """GIVEN the same rows taken as fresh, THEN the position claims to be at least twice as certain."""
    gps = dresden.assembly.config.sensor["gps"].model_copy(update={"repeats": "fresh"})
    config = dresden.assembly.config
    config = config.model_copy(update={"sensor": config.sensor | {"gps": gps}})
    fresh = dataclasses.replace(dresden, assembly=assemble(config))
    honest, sure = dresden.run().final["std"], fresh.run().final["std"]
    assert fresh.run().sensors["gps"].used == 10_800
    assert sure["x"] < 0.7 * honest["x"]
    assert sure["y"] < 0.7 * honest["y"]


def test_the_heading_is_found_from_any_start(dresden):
    """GIVEN a heading wrong by up to half a turn, WHEN the car drives off, THEN it is within 0.1 rad after 8 s."""
    config = dresden.assembly.config
    at = np.searchsorted(dresden.t_s, 8.0)
    for yaw_rad in (-2.0, -1.0, 1.0, 2.0, 3.0):
        initial = config.initial.model_copy(update={"state": config.initial.state | {"yaw_rad": yaw_rad}})
        other = assemble(config.model_copy(update={"initial": initial}))
        found = dataclasses.replace(dresden, assembly=other).reports["x"][at, 2]
        assert abs(np.angle(np.exp(1j * (found - 1.06)))) < 0.1


def test_rows_lie_on_a_steady_clock_whenever_they_were_written(dresden):
    """Stamps are 20 ms apart; the logger wrote up to 1.8 s late at 100 s, and was on time at both ends."""
    rows = dresden.readings[dresden.of("gps")]
    assert set(np.diff(rows["t_ns"])) == {20_000_000}
    behind_s = (rows["arrival_ns"] - rows["t_ns"]) / 1e9
    assert 1.6 < behind_s.max() < 1.8
    assert np.abs(behind_s[[0, -1]]).max() < 0.05


@pytest.mark.parametrize("period", ["-0.02", "inf", '"20 ms"'])
def test_a_steady_clock_needs_a_period(period, tmp_path):
    mapping = (CONFIGS / "import" / "dresden_car.toml").read_text()
    (tmp_path / "map.toml").write_text(mapping.replace("every_s = 0.02", f"every_s = {period}"))
    with pytest.raises(ConfigError, match=r"every_s: .* is no period"):
        read_mapping(tmp_path / "map.toml")
