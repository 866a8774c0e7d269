"""GIVEN the reference plant with two sensors WHEN one is wrong by little and nobody excludes it THEN no more errors
exceed the protection level in its estimates than promised, with no fault and with one."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from numpy.typing import NDArray

from fusiond.assembly.assembly import Assembly
from fusiond.engine.engine import Engine
from fusiond.faults.protection import quantile
from tools.scoreboard.plants import REFERENCE, plant_of, sensed
from tools.scoreboard.watching import assembled, readings_of

OUTSIDE, RUNS, STEPS, SETTLED = 0.02, 60, 150, 50
ATTENTIVE_S = 36_000.0
Shares = NDArray[np.float64]


@functools.cache
def guarded() -> Assembly:
    """Both sensors read the same output."""
    faults = {"protect": ["x1"], "protect_outside": OUTSIDE, "window": 64}
    return assembled(sensed(REFERENCE, {"y1": 1.0, "y2": 1.0}, ATTENTIVE_S, **faults))


class Deaf:
    """Stands where the judge stands and excludes nobody."""

    def consider(self, engine: Engine) -> None:
        """Let the alarm be."""


def shares(bias: float, *, judged: bool, seed: int) -> tuple[Shares, Shares]:
    """(RUNS,) share of each run's settled samples outside the level, and outside the same quantile of std alone."""
    assembly = guarded()
    engine, plant = assembly.engine(), plant_of(assembly.config.model_dump())
    if not judged:
        engine._judge = Deaf()  # type: ignore[assignment]
    z, states = plant.run(np.random.default_rng(seed), RUNS, STEPS)
    z[:, :, 0] += bias
    beyond_level, beyond_std = [], []
    for readings, truth in zip(readings_of(assembly, z), states, strict=True):
        engine.reset()
        last = engine.process(readings)[1::2][SETTLED:]
        error = np.abs(last["x"][:, 0] - truth[SETTLED:, 0])
        beyond_level.append(np.mean(error > last["protection"][:, 0]))
        beyond_std.append(np.mean(error > quantile(OUTSIDE) * last["std"][:, 0]))
    return np.array(beyond_level), np.array(beyond_std)


def lowest(share: Shares) -> float:
    """Lower end of the mean's interval at three deviations; runs are independent, samples within one are not."""
    return float(np.mean(share) - 3.0 * np.std(share) / np.sqrt(len(share)))


@pytest.mark.parametrize("judged", [False, True])
@pytest.mark.parametrize("bias", [0.0, 1.0, 2.0])
def test_no_more_errors_exceed_the_level_than_promised(bias: float, judged: bool) -> None:
    assert lowest(shares(bias, judged=judged, seed=int(10 * bias))[0]) <= OUTSIDE


def test_the_deviation_alone_would_not_have_held() -> None:
    """Under the same bias the filter's own deviation is exceeded far more often: the promise is not empty."""
    level, std = shares(2.0, judged=False, seed=20)
    assert lowest(std) > 3.0 * OUTSIDE
    assert np.mean(level) <= OUTSIDE
