"""The closed loop while a sensor lies: the goal is kept, or the plant is made safe in time; no unsafe command.

The whole catalogue is measured by `python -m tools.pages.control_page` (docs/control.md); here a fault of each family.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fusiond.assembly.assembly import load
from tools.pages.loop_faults import BEGIN_S, CATALOGUE, FaultLoop

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
KEPT = (
    "range spike", "range late", "acceleration off", "acceleration frozen", "acceleration not a number",
    "acceleration spike",
)  # fmt: skip
STOPPED = ("range off", "range frozen", "range drift")
DURATION_S = 16.0


@pytest.fixture(scope="module", params=["minicar_lqg", "birotor_lqg"])
def loop(request):
    """One plant, its daemon's engine, and its distance from the goal without a fault, root mean square."""
    assembly = load(CONFIGS / f"{request.param}.toml")
    closed = FaultLoop(assembly.engine(), assembly.design[0], request.param)
    run = closed.run([], DURATION_S)
    assert not run.unsafe
    return closed, run.rms_m(closed.goal_m)


def outcome(loop, name):
    closed, fault_free_m = loop
    run = closed.run([CATALOGUE[name]], DURATION_S)
    return run, run.rms_m(closed.goal_m) / fault_free_m


def test_without_a_fault_the_goal_is_kept_to_millimetres(loop):
    assert loop[1] < 0.004


@pytest.mark.parametrize("name", KEPT)
def test_a_loop_that_loses_nothing_it_needs_keeps_its_goal(loop, name):
    """Within three times the fault-free distance, commands valid to the end: GIVEN a fault of the accelerometer or a
    passing one of the range finder, WHEN it comes at 10 s, THEN the plant stays where it was."""
    run, times = outcome(loop, name)
    assert not run.unsafe
    assert run.safe_after_s() is None
    assert times <= 3.0


@pytest.mark.parametrize("name", STOPPED)
def test_a_loop_without_a_sound_position_is_made_safe_in_time(loop, name):
    """GIVEN the only position sensor, WHEN it falls silent or is found to lie, THEN the safe command within the time
    that the configuration allows, and it stays."""
    closed, _ = loop
    run, _ = outcome(loop, name)
    assert not run.unsafe
    assert run.safe_after_s() is not None
    assert run.lost_after_s() is not None
    assert run.safe_after_s() - run.lost_after_s() <= closed.allowed_s


def test_an_unsafe_command_would_be_seen(loop):
    """The judge of the runs is told stricter limits than the engine keeps, and counts."""
    closed, _ = loop
    strict = closed._design.copy()
    strict["lowest"], strict["highest"] = strict["lowest"] + 0.8, strict["highest"] - 0.8
    strict["reckoning_ns"] = -int(strict["dead_reckoning_ns"]) - 1
    seen = FaultLoop(closed.engine, strict, closed.engine.layout.name).run([], BEGIN_S / 2.0).unsafe
    assert seen["beyond its limits"] > 0
    assert seen["of a stale estimate"] > 0


def test_the_closed_loop_is_the_same_bits_again(loop):
    closed, _ = loop
    runs = [closed.run(["accelerometer.broken@2"], 5.0).position_m for _ in range(2)]
    assert np.array_equal(*runs)
