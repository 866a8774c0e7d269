"""The scoreboard's own tools: the oracle against the exact bound, the bands, and a short run of one part."""

from __future__ import annotations

import json

import numpy as np
import pytest

from fusiond.numerics.cusum import shift_delay, shift_threshold
from fusiond.types import Alarm, Kind
from tools.scoreboard.__main__ import main
from tools.scoreboard.bands import mean_interval, share
from tools.scoreboard.board import QUICK, Effort
from tools.scoreboard.delays import settled_innovations
from tools.scoreboard.exclusion import adapted_row
from tools.scoreboard.judging import judged
from tools.scoreboard.oracle import delays_of, profile, threshold
from tools.scoreboard.plants import REFERENCE, STATIC, VELOCITY, plant_of, sensed
from tools.scoreboard.recordings import coverage_row, recordings_part
from tools.scoreboard.watching import assembled, readings_of


def test_the_oracle_is_the_exact_cusum_where_residuals_are_white():
    rng = np.random.default_rng(1)
    healthy = rng.standard_normal((64, 10_000))
    w = np.full(60, 2.0)
    h = threshold(healthy, w, 1000.0)
    assert h == pytest.approx(shift_threshold(1000.0, 2.0), abs=0.15)
    delays = delays_of(rng.standard_normal((4000, 60)) + 2.0, w, h, 0)
    assert delays.mean() == pytest.approx(shift_delay(h, 2.0), rel=0.03)


def test_the_profile_is_the_mean_of_the_innovations_of_a_faulty_sensor():
    plant = plant_of(sensed(REFERENCE, {"y": 1.0}, 1e4))
    z = plant.run(np.random.default_rng(2), 4000, 120)[0]
    z[:, 100:] += 5.0
    e = settled_innovations(plant, z)
    assert e[:, 60:100].std() == pytest.approx(1.0, abs=0.01)
    np.testing.assert_allclose(e[:, 100:].mean(axis=0), profile(plant, np.full(20, 5.0)), atol=0.08)


def test_an_alarm_leaves_no_cell_with_evidence():
    """What one excursion of the noise did to several cells is one alarm, so that thresholds mean what they promise."""
    config = sensed(STATIC, {"y": 1.0}, 300.0)
    assembly, left = assembled(config), []

    class Watcher:
        def consider(self, engine):
            monitor = engine.track[0]["monitor"]
            if monitor["alarm"] == Alarm.CELL:
                left.append(float(np.abs(monitor["llr"]).max()))
            monitor["alarm"] = Alarm.NONE

    engine = assembly.engine()
    engine._judge = Watcher()
    engine.process(readings_of(assembly, plant_of(config).run(np.random.default_rng(4), 1, 30_000)[0])[0])
    assert len(left) > 20
    assert max(left) == 0.0


def test_a_drift_is_told_as_the_error_it_has_grown_to():
    """A rate is no size of a bias: what is compared is how far off the sensor is said to be."""
    assembly = assembled(sensed(VELOCITY, {"y1": 0.1, "y2": 0.1, "y3": 0.1}, 36_000.0))
    z = plant_of(assembly.config.model_dump()).run(np.random.default_rng(5), 1, 140)[0]
    z[:, 100:, 1] += 0.3 * np.arange(1.0, 41.0)
    (found,) = judged(assembly, assembly.engine(), z, 100)
    assert (found.named, found.kind) == ((1,), Kind.DRIFT)
    assert found.error == pytest.approx(0.3 * (found.step - 99), abs=0.15)


def test_every_open_line_of_the_catalogue_is_counted():
    proven = "| F1 | GPS step | +20 m | `test` |\n"
    row = coverage_row(
        f"# Catalogue\n{proven}| F19 | the filter dies | measured gap | **not measured** yet |\n"
    )
    assert (row.value, row.ok) == (0.5, False)
    assert "F19" in row.name
    assert coverage_row(proven).ok


def test_where_there_are_no_recordings_none_is_measured(monkeypatch, tmp_path):
    monkeypatch.setenv("FUSIOND_DATA", str(tmp_path / "nowhere"))
    rows = recordings_part(QUICK).rows
    assert [row.name.split(":")[0] for row in rows if "recordings" in row.id] == ["not measured"]
    assert not rows[-1].ok


def test_intervals_hold_what_they_should():
    band = mean_interval(1e6, 100)
    assert (band.value, band.low < 1e4 < band.high) == (1e4, True)
    assert mean_interval(1e6, 0).low == pytest.approx(1e6 / 2.996, rel=1e-3)
    assert share(0, 100).low == 0.0
    assert share(0, 100).high == pytest.approx(0.0362, abs=1e-3)


def test_a_wrong_plant_keeps_the_variance_of_correlated_noise():
    plant = plant_of(sensed(STATIC, {"y": 2.0}, 1e4)).wrong(correlation=0.3)
    z = plant.run(np.random.default_rng(3), 200, 400)[0][:, :, 0]
    assert z.var() == pytest.approx(4.0, rel=0.03)
    assert np.mean(z[:, 1:] * z[:, :-1]) / z.var() == pytest.approx(0.3, abs=0.02)


def test_after_an_exclusion_the_noise_that_was_learnt_is_that_of_a_run_without_the_sensor():
    """RMSE within 5 % of a run that never had the sensor, with its noise estimated, in six runs."""
    row = adapted_row(Effort(0.1))
    assert "excluded in 6 of 6 runs" in row.name
    assert row.value <= 1.05


def test_a_short_run_ends_with_its_rows_as_one_json_object(capsys, tmp_path):
    page = tmp_path / "scoreboard.md"
    options = ["--quick", "--processes", "1", "--write", str(page), "--keep", str(tmp_path / "kept")]
    main([*options, "--only", "white"])
    rows = json.loads(capsys.readouterr().out.splitlines()[-1])["rows"]
    assert {row["id"] for row in rows} >= {"2.white.sharp.0.5", "2.white.sharp.3.0", "2.service.robust.1.0"}
    assert all(0.8 < row["ratio"] < 2.0 for row in rows if row["id"].startswith("2.white"))
    assert (tmp_path / "pictures" / "scoreboard_delay.svg").is_file()
    assert "exact CUSUM" in page.read_text(encoding="utf-8")

    main([*options, "--only", "outages"])
    both = json.loads(capsys.readouterr().out.splitlines()[-1])["rows"]
    assert both[: len(rows)] == rows
    assert len(both) > len(rows)
