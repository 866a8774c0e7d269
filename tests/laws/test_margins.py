"""Margins of a loop, against python-control and against what really makes it unstable."""

from __future__ import annotations

import control
import numpy as np
import pytest

from fusiond.assembly.loop_summary import margins_of
from fusiond.assembly.settled import Mover, events_of, settled_at_begin
from fusiond.control.margins import disk_margin, estimated_loop, regulator_loop
from tools.pages.trials import configured


@pytest.fixture(scope="module")
def resolved():
    return configured("reference_plant_lqg").resolved


def with_filter(resolved):
    P = settled_at_begin(*events_of(resolved), Mover(resolved), 3)
    H = np.array([[1.0, 0.0, 0.0]] * 2)
    M = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.diag([1.0, 2.0]))
    return estimated_loop(resolved.law.plan, H, M), M @ H


def test_the_disk_margin_is_python_controls(resolved):
    for loop in (regulator_loop(resolved.law.plan), with_filter(resolved)[0]):
        system = control.ss(loop.A, loop.B, -loop.C, np.zeros((1, 1)), 1.0)
        theirs = control.disk_margins(system, np.pi * np.geomspace(1e-5, 1.0, 4000))
        ours = disk_margin(loop)
        assert ours.alpha == pytest.approx(float(theirs[0]), rel=1e-3)
        assert 20.0 * np.log10(ours.gain[1]) == pytest.approx(float(theirs[1]), rel=1e-3)
        assert np.degrees(ours.phase_rad) == pytest.approx(float(theirs[2]), rel=1e-3)


def test_every_gain_inside_the_margin_leaves_the_loop_stable_and_some_outside_does_not(resolved):
    loop = with_filter(resolved)[0]
    least, most = disk_margin(loop).gain
    largest = {
        gain: max(abs(np.linalg.eigvals(loop.A + gain * loop.B @ loop.C))) for gain in (least, 1.0, most, 6.0)
    }
    assert max(largest[least], largest[1.0], largest[most]) < 1.0
    assert largest[6.0] > 1.0


def test_poles_are_those_of_regulator_and_filter_side_by_side(resolved):
    """Separation."""
    loop, seen = with_filter(resolved)
    plan = resolved.law.plan
    F = plan.plant.F
    apart = [*np.linalg.eigvals(F - plan.plant.B @ plan.K), *np.linalg.eigvals(F - F @ seen)]
    assert np.allclose(np.sort_complex(loop.poles), np.sort_complex(np.array(apart)), atol=1e-8)


@pytest.mark.parametrize("name", ["reference_plant_lqg", "minicar_lqg", "birotor_lqg", "single_track_lqg"])
def test_every_regulated_configuration_says_what_it_bears(name):
    """Stable, and no factor between 0.6 and 1.6 of its gain makes it otherwise."""
    told = margins_of(configured(name).resolved)
    for loop in (told["regulator"], told["with_estimate"]):
        if loop is not None:
            assert all(np.hypot(*pole) < 1.0 for pole in loop["poles"])
            assert loop["gain_margin"][0] < 0.6
            assert loop["gain_margin"][1] > 1.6
    assert (told["with_estimate"] is not None) == (name == "reference_plant_lqg")


def test_a_law_that_was_not_designed_says_nothing():
    assert margins_of(configured("minicar").resolved) == {}
