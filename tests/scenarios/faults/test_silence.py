"""How long a stream may say nothing: two and a half periods, or what its own losses have taught."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.engine.records import HAS_ARRIVAL
from fusiond.simulation.registry import simulate
from fusiond.types import Health
from tests.scenarios.faults.drive import lasting, scene
from tools.pages.trials import records

PERIOD_S = 0.1
LEARNT_S = 100.0
"""A thousand readings, of which some late ones."""


def lossy(share, seed):
    """A change of a log that loses this share of its readings, whoever's they are."""
    return lambda log, layout: log[np.random.default_rng(seed).random(len(log)) >= share]


def silences(run, after_s):
    """Times at which a sensor fell silent."""
    return [
        turn.at_s
        for sensor in run.layout.sensors
        for turn in run.turns(sensor.name)
        if turn.health is Health.SILENT and turn.at_s > after_s
    ]


def told_after_s(run, stopped_s):
    """From the sensor's last reading to the report that calls it silent."""
    return run.when("y1", Health.SILENT, stopped_s) - stopped_s


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("share", [0.05, 0.1])
def test_a_stream_that_loses_readings_is_not_called_silent(share, seed):
    """GIVEN one reading of twenty or of ten lost, so that gaps of three periods and more are daily bread,
    WHEN that has been so for a thousand readings THEN none of three streams is called silent in five thousand more.
    """
    run = scene("three_positions").drive(600.0, seed=seed, change=lossy(share, seed))
    gaps_ns = np.diff(run.reports["t_ns"][run.reports["sensor"] == run.layout.numbers["y1"]])
    assert np.sum(gaps_ns > lasting(2.5 * PERIOD_S)) > 5
    assert silences(run, LEARNT_S) == []


@pytest.mark.parametrize(("share", "within"), [(0.0, 3), (0.05, 11), (0.1, 11)])
def test_a_stream_that_ends_is_called_silent(share, within):
    """A stream that ends is called silent with the first reading after 2.5 periods; a lossy one after ten at most."""
    run = scene("three_positions").drive(300.0, ["y1.broken@200"], 0, lossy(share, 0))
    last_s = run.t_s[(run.reports["sensor"] == run.layout.numbers["y1"])][-1]
    assert 2.0 * PERIOD_S < told_after_s(run, last_s) <= (within + 0.01) * PERIOD_S


def test_a_regular_stream_that_begins_to_lose_half_is_called_silent():
    """GIVEN a regular stream WHEN every other reading gets lost from 200 s on THEN it is called silent within 2 s."""
    run = scene("three_positions").drive(300.0, ["y1.intermittent=0.5@200"])
    assert run.when("y1", Health.SILENT) > 200.0
    assert run.when("y1", Health.SILENT) <= 202.0


@pytest.mark.parametrize(("delay_s", "jitter_s"), [(0.2, 0.0), (0.5, 0.0), (0.0, 0.3)])
def test_a_sensor_whose_readings_come_late_is_not_called_silent(delay_s, jitter_s):
    """GIVEN one of three sensors at 10 Hz whose readings are under way for longer than it may be silent, or for a
    random time that puts them out of order, WHEN that has been so for ten seconds THEN it is not called silent; and
    when it ends, it is.
    """
    here = scene("three_positions")
    simulation = simulate(
        "constant_velocity", 0, 100.0, R=(0.01, 0.01, 0.01), inject=["y2.broken@80"],
        delay_s={"y2": delay_s}, jitter_s={"y2": jitter_s},
    )  # fmt: skip
    log = records(here.layout, simulation.readings)
    log["arrival_ns"], log["flags"] = simulation.arrivals_ns, log["flags"] | HAS_ARRIVAL
    run = here.run(log, simulation)
    assert [at_s for at_s in silences(run, 10.0) if at_s < 80.0] == []
    assert 80.0 < run.when("y2", Health.SILENT, 80.0) <= 80.0 + 0.25 + 2.5 * (delay_s + jitter_s)
