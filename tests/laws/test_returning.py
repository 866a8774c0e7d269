"""An input that is out waits its own time, whoever else is looked at meanwhile."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.engine.reactions import Reactions
from fusiond.engine.returning import RETRY_S, retry
from fusiond.types import NANOSECONDS, Health, Kind
from tests.scenarios.faults.drive import scene

OUT_S, NOW_S = 1.0, 3.0


@pytest.fixture
def reactions():
    """A mini car at 3 s whose accelerometer has been out since 1 s; a retry is due, though not its own."""
    stage = scene("minicar")
    stage.engine.reset()
    stage.engine.process(stage.log(NOW_S))
    found = Reactions(stage.engine, np.zeros((len(stage.layout.sensors), stage.layout.shape.payload)))
    sensor = stage.layout.numbers["accelerometer"]
    said = {
        "excluded": 1,
        "health": Health.EXCLUDED,
        "kind": Kind.BIAS,
        "since_ns": round(OUT_S * NANOSECONDS),
    }
    for field, value in said.items():
        found.write(field, value, sensor)
    stage.engine.desk[0]["retry_ns"] = found.now_ns
    yield found
    stage.engine.reset()


def test_a_look_at_another_sensor_does_not_restart_an_inputs_wait(reactions):
    """It is tried when it has waited its five seconds, not five seconds after somebody else's turn."""
    retry(reactions, ())
    sensor = reactions.layout.numbers["accelerometer"]
    assert reactions.reaction["health"][sensor] == Health.EXCLUDED
    assert reactions.reaction["since_ns"][sensor] == round(OUT_S * NANOSECONDS)
    assert reactions.engine.desk[0]["retry_ns"] == round((OUT_S + RETRY_S) * NANOSECONDS)


def test_an_input_that_has_waited_is_tried(reactions):
    """Six seconds out: used again, on probation from now on."""
    sensor = reactions.layout.numbers["accelerometer"]
    reactions.write("since_ns", reactions.now_ns - 6 * NANOSECONDS, sensor)
    retry(reactions, ())
    assert reactions.reaction["health"][sensor] == Health.PROBATION
    assert reactions.reaction["since_ns"][sensor] == reactions.now_ns
    assert sensor not in reactions.out()


@pytest.mark.parametrize(("share", "tried"), [(0.4, True), (0.6, False)])
def test_an_input_is_tried_where_it_reads_nearer_to_its_stand_in_than_to_its_error(reactions, share, tried):
    """An error of 1 m/s^2, of which the readings within the horizon still show a share: half of it decides."""
    sensor = reactions.layout.numbers["accelerometer"]
    reactions.write("since_ns", reactions.now_ns - 6 * NANOSECONDS, sensor)
    reactions.write("size", 1.0, sensor)
    read = float(np.mean(reactions.engine.recent(sensor)["z"][:, 0]))
    reactions.engine.track[0]["monitor"]["usual"][sensor, 0] = read - share
    retry(reactions, ())
    health = reactions.reaction["health"][sensor]
    assert health == (Health.PROBATION if tried else Health.EXCLUDED)
    assert reactions.engine.desk[0]["retry_ns"] == reactions.now_ns + round(
        RETRY_S * (2.0 if tried else 1.0) * NANOSECONDS
    )
