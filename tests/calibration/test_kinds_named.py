"""What a fault is called first: kinds are named by a ratio of evidences of 100."""

from __future__ import annotations

import pytest

from fusiond.types import Kind
from tools.pages.trials import merged
from tools.scoreboard.adaptation import first_names, lying
from tools.scoreboard.plants import REFERENCE, plant_of, sensed
from tools.scoreboard.watching import assembled

RUNS = 400


@pytest.mark.parametrize(
    ("kind", "size", "within", "often"), [(Kind.NOISE, 10.0, 10, 0.95), (Kind.BIAS, 10.0, 5, 0.9)]
)
def test_a_fault_is_called_what_it_is(kind: Kind, size: float, within: int, often: float) -> None:
    """95 % (a bias: 90 %) of 400 runs are named in time, and no more than 2 % are first called something else.

    Noise whose first few readings happen to agree is what a bias looks like. One in a hundred is what a ratio of 100
    allows of noise of the size expected beforehand; of noise of ten sigma 1.7 % were measured (2400 runs).
    """
    config = merged(sensed(REFERENCE, {"y": 1.0}, 36_000.0), {"adaptation": {}})
    assembly = assembled(config)
    told = first_names(assembly, assembly.engine(), lying(plant_of(config), kind, size, RUNS, 6200))
    wrong = sum(one[1] not in (kind, Kind.NONE) for one in told)
    right = sum(one[1] is kind and one[0] <= within for one in told)
    assert wrong <= 0.02 * RUNS
    assert right >= often * RUNS
