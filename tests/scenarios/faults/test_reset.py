"""A reset holds, wherever in the history it comes."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.types import RESET, Action
from tests.scenarios.faults.drive import lasting, scene


@pytest.mark.parametrize("after", [1, 7, 8, 9, 100])
def test_a_reset_is_not_undone_by_the_snapshots_kept_before_it(after):
    """GIVEN some readings since the last reset WHEN another comes THEN it counts, and the next reading starts anew."""
    stage = scene("reference_plant")
    log = stage.clean(60.0, 0)
    event = np.zeros(1, stage.layout.reading)
    event["sensor"], event["t_ns"] = RESET, lasting(30.0)
    stage.engine.reset()
    stage.engine.process(np.concatenate((event, log[:after], event)))
    track = stage.engine.track[0]
    assert track["resets"] == 2
    assert track["started"] == 0
    first = stage.engine.process(log[:1]).copy()
    assert stage.engine.track[0]["resets"] == 2
    stage.engine.reset()
    fresh = stage.engine.process(np.concatenate((event, event, log[:1])))
    np.testing.assert_array_equal(first["x"][0], fresh["x"][-1])
    assert first["action"][0] == Action.NONE
