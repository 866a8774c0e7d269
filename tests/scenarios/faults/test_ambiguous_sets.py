"""Two equal sensors on an integrator: nothing lasting tells them apart, so the set is told, however they jump."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.assembly.diagnosis import diagnosis_of
from fusiond.types import Health, Verdict
from tests.scenarios.faults.drive import scene


def test_the_matrix_calls_two_equal_positions_ambiguous():
    """GIVEN constant velocity with two equal positions, THEN a bias of either cannot be told from the other's."""
    assembly = scene("two_positions").assembly
    assert assembly.detection is not None
    rows = [row for row in diagnosis_of(assembly.resolved, assembly.detection) if row["kind"] == "bias"]
    assert [row["ambiguous_with"] for row in rows] == [["y2"], ["y1"]]


@pytest.mark.parametrize("sensor", ["y1", "y2"])
@pytest.mark.parametrize("bias_m", [0.3, 0.6, -1.0, 3.0])
@pytest.mark.parametrize("seed", [0, 1])
def test_the_verdict_is_the_set_the_matrix_gives(sensor, bias_m, seed):
    """3, 6, 10 and 30 deviations: neither is ever named, both are suspected of the other's fault; both still count."""
    run = scene("two_positions").drive(60.0, [f"{sensor}.bias={bias_m}@30"], seed)
    assert not run.blamed("y1"), run.story()
    assert not run.blamed("y2"), run.story()
    told = (run.reports["suspects"] != 0).all(axis=1)
    assert told.any()
    first = int(np.argmax(told))
    assert 30.0 <= run.t_s[first] <= 33.0
    assert set(run.reports["health"][first]) == {Health.SUSPECT}
    assert set(run.reports["verdict"][first:]) <= {Verdict.USED, Verdict.GATED}
