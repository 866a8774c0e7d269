"""The diagnosability matrix against closed forms: information of a bias, what can be told apart, what cures."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from fusiond.assembly.design import layout_of
from fusiond.assembly.detection import detection_of
from fusiond.assembly.diagnosis import diagnosis_of
from fusiond.assembly.resolve import resolve
from fusiond.config import parse
from fusiond.faults.thresholds import Promise
from fusiond.types import Kind

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
MORE = """
[sensor.{name}]
kind = "linear"
H = [[1.0, 0.0]]
channels = ["y"]
rate_hz = 10.0
noise_std = {{ y = 0.1 }}
"""


def text_of(name, without="", more=()):
    text = (CONFIGS / f"{name}.toml").read_text(encoding="utf-8")
    if without:
        text = re.sub(rf"\[sensor\.{without}\].*?(?=\n\[)", "", text, flags=re.DOTALL)
    return text + "\n" + "\n".join(MORE.format(name=extra) for extra in more)


@cache
def design(name, without="", more=()):
    resolved = resolve(parse(text_of(name, without, more), name), CONFIGS)
    return resolved, detection_of(resolved, layout_of(resolved), Promise(1e4))


@cache
def rows(name, without="", more=()):
    return diagnosis_of(*design(name, without, more))


def row(found, sensor, kind):
    return next(one for one in found if one["sensor"] == sensor and one["kind"] == kind.label)


def inverse_spectrum(H, A, Q, R):
    """Phi_y(0)^-1 of a stable model: what the readings' spectral density at zero frequency leaves of a constant."""
    through = H @ np.linalg.inv(np.eye(len(A)) - A)
    return np.linalg.inv(R + through @ Q @ through.T)


@pytest.mark.parametrize("sensors", [1, 2])
def test_a_bias_leaves_the_information_of_the_spectrum_at_zero_frequency(sensors):
    A = np.array([[1.1269, -0.4940, 0.1129], [1, 0, 0], [0, 1, 0]])
    G = np.array([[-0.3832], [0.5919], [0.5191]])
    H = np.tile([[1.0, 0.0, 0.0]], (sensors, 1))
    J = inverse_spectrum(H, A, 2.3 * G @ G.T, np.eye(sensors))
    found = row(rows("reference_plant", "" if sensors == 2 else "y2"), "y1", Kind.BIAS)
    assert found["information"]["each"] == pytest.approx(J[0, 0], rel=1e-3)
    assert 0.5 * J[0, 0] == pytest.approx({1: 0.0425, 2: 0.2611}[sensors], abs=5e-5)


def test_what_tells_two_sensors_apart_is_what_one_shows_alone():
    """Schur complement: isolating y1 from y2 takes what detecting it takes where y2 is not there."""
    pair, alone = (
        row(rows("reference_plant"), "y1", Kind.BIAS),
        row(rows("reference_plant", "y2"), "y1", Kind.BIAS),
    )
    left = pair["told_apart"] * pair["information"]["each"]
    assert left == pytest.approx(alone["information"]["each"], rel=2e-3)
    assert pair["ambiguous_with"] == []


def test_a_bias_that_the_state_learns_has_finite_information():
    found = row(rows("constant_velocity"), "y1", Kind.BIAS)
    assert 0.5 * found["information"]["total"] * 0.1**2 == pytest.approx(0.5556, rel=5e-4)
    assert "learns" in found["reason"]
    assert [cure["state"] for cure in found["cured_by"]] == ["position"]


def test_two_equal_sensors_of_one_position_cannot_be_told_apart_three_can():
    two = rows("constant_velocity", "", ("y2",))
    assert row(two, "y1", Kind.BIAS)["ambiguous_with"] == ["y2"]
    assert row(two, "y2", Kind.BIAS)["ambiguous_with"] == ["y1"]
    assert [cure["state"] for cure in row(two, "y1", Kind.BIAS)["cured_by"]] == ["position"]
    three = row(rows("constant_velocity", "", ("y2", "y3")), "y1", Kind.BIAS)
    assert three["ambiguous_with"] == []
    assert three["told_apart"] == pytest.approx(0.75, abs=1e-3)


def test_twice_the_bias_takes_a_quarter_of_the_readings():
    found = row(rows("reference_plant"), "y1", Kind.BIAS)
    (small, long_s), (twice, short_s) = found["delays_s"][:2]
    assert twice == pytest.approx(2.0 * small)
    assert long_s / short_s == pytest.approx(4.0, rel=0.02)


def test_twice_the_drift_takes_less_by_the_cube_root_of_four():
    found = row(rows("reference_plant"), "y1", Kind.DRIFT)
    (small, long_s), (twice, short_s) = found["delays_s"][:2]
    assert twice == pytest.approx(2.0 * small)
    assert long_s / short_s == pytest.approx(4.0 ** (1.0 / 3.0), rel=0.02)


def test_every_kind_has_a_row_for_every_updating_sensor():
    kinds = {one["kind"] for one in rows("reference_plant") if one["sensor"] == "y1"}
    assert kinds == {"bias", "drift", "scale", "delay", "noise", "stuck", "silent", "garbage"}
    assert not any(
        one["kind"] in {"scale", "delay"} for one in rows("reference_plant") if one["sensor"] == "applied"
    )


def test_cells_are_sorted_by_sensor_in_pairs_of_either_sign():
    _, found = design("reference_plant")
    assert np.all(np.diff(found.cell_sensor) >= 0)
    assert np.array_equal(found.cell_theta[::2], -found.cell_theta[1::2])
    assert np.array_equal(
        found.last - found.first, np.bincount(found.cell_sensor, minlength=len(found.first))
    )
    assert np.all(found.cell_h >= 1.0)
    assert np.all(np.isfinite(found.cell_h))
