"""Seed 000: the mini car and the bi-rotor at their goals, by the engine's own command."""

from __future__ import annotations

import numpy as np
import pytest

from tools.pages import seed_000
from tools.pages.seed_000 import EXAMPLES, LAST_S, OFFSETS_M
from tools.pages.seed_000_rows import steered


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name)
def test_fused_holds_the_goal(example):
    """GIVEN the shipped configuration; WHEN 30 s are over; THEN the last 10 s are within 2.5 mm RMS of the goal."""
    run = steered(example, 0)
    assert run.loop.rms_from(example.goal_m, LAST_S) < 2.5e-3

    # AND the accelerometer's offset is known within four of its standard deviations, which are below 1 mm/s^2
    bias = example.rig(0).acceleration_bias_m_s2
    assert abs(run.x[-1, 2] - bias) < 4.0 * run.std[-1, 2] < 4e-3

    # AND no command left the assumed saturation
    weight = example.rig(0).plant.weight_n
    assert np.abs(run.loop.force_n - weight).max() <= 1.0 + 1e-12


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.name)
def test_the_other_scenarios_are_as_the_seed_says(example):
    """Ideal: there. Accelerometer only: hundreds of metres off. Ultrasonic only: there, but it trembles."""
    names = ("ideal", "accelerometer", "ultrasonic")
    rms_m = {name: seed_000.unfused(example, name).rms_from(example.goal_m, LAST_S) for name in names}
    assert rms_m["ideal"] < 1e-4
    assert 200.0 < rms_m["accelerometer"] < 500.0
    assert 1e-3 < rms_m["ultrasonic"] < 10e-3


@pytest.mark.parametrize("Q22", [1e-8, 1e-6, 1e-3])
def test_without_a_bias_state_the_car_stops_beside_the_goal(Q22):
    """By the formula within 2 %, and by the tabulated figure within 3 % (its force follows each correction)."""
    offset_m = seed_000.offset_m(Q22)
    assert offset_m == pytest.approx(seed_000.predicted_offset_m(Q22), rel=0.02)
    assert offset_m == pytest.approx(OFFSETS_M[Q22], rel=0.03)


def test_the_formula_is_the_table():
    """Fed back after the correction, the analytic offset is the tabulated one to its digits."""
    for Q22, table_m in OFFSETS_M.items():
        assert seed_000.predicted_offset_m(Q22, before_correction=False) == pytest.approx(table_m, abs=1.1e-3)


def test_a_greater_process_noise_makes_a_quicker_filter():
    """The seed says slower. The offset of a filter that trusts the accelerometer less is smaller."""
    offsets_m = [seed_000.predicted_offset_m(Q22) for Q22 in OFFSETS_M]
    assert offsets_m == sorted(offsets_m, reverse=True)
