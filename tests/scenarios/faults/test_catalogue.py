"""Lines of docs/catalogue.md that no other scenario has: jumps after a gap, undeclared noise, stamps."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.types import Health, Kind, Verdict
from tests.scenarios.faults.drive import lasting, scene


def test_a_jump_of_700_m_after_a_gap_is_not_followed():
    """No fix for 10 s, then 700 m off in x for good: the position stays within 50 m, wheels and gyro unblamed (F1)."""
    run = scene("plane").drive(40.0, ["gps.broken@15+10", "gps.0.bias=700@25"])
    assert run.worst("x", 15.0) < 50.0, run.story()
    assert run.worst("y", 15.0) < 50.0, run.story()
    assert not run.blamed("wheel_speed"), run.story()
    assert not run.blamed("gyro"), run.story()


def test_noise_ten_times_the_declared_one_locks_nobody_out():
    """From 15 s on 5 m, not 0.5 m: named noise; in the last 10 s NIS is back near 2, nine in ten are used (F14)."""
    run = scene("plane").drive(40.0, ["gps.noise=10@15"])
    assert run.named("gps").kind is Kind.NOISE, run.story()
    late = (run.reports["sensor"] == run.layout.numbers["gps"]) & (run.t_s > 30.0)
    assert np.mean(run.reports["verdict"][late] == Verdict.USED) >= 0.9
    assert 1.0 < np.mean(run.reports["nis"][late]) < 3.2


@pytest.mark.parametrize("count", [1, 10])
def test_stamps_150_ms_too_early_move_no_state_and_no_flag(count):
    """One or ten readings of the gyro stamped 150 ms early: no jump; ten leave a gap, and that is silence (F12)."""
    stage = scene("plane")

    def change(log, layout):
        rows = np.flatnonzero((log["sensor"] == layout.numbers["gyro"]) & (log["t_ns"] > lasting(20.0)))
        log["t_ns"][rows[:count]] -= lasting(0.15)
        return log

    clean, run = stage.drive(30.0), stage.drive(30.0, change=change)
    assert np.array_equal(clean.health("gyro")[-1:], run.health("gyro")[-1:])
    assert {turn.health for turn in run.turns("gyro")} <= {Health.HEALTHY, Health.SILENT}, run.story()
    assert count == 10 or run.story() == "nobody was ever blamed"
    moved = np.abs(run.reports["x"][-1] - clean.reports["x"][-1])
    assert np.all(moved <= clean.reports["std"][-1])
