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
from fusiond.recording.replay import replay
from fusiond.recording.truth import Truth
from tools.pages.trials import merged
from tools.scoreboard.plants import REFERENCE, plant_of, sensed
from tools.scoreboard.watching import assembled, readings_of

OUTSIDE, RUNS, STEPS, SETTLED = 0.02, 60, 150, 50
ATTENTIVE_S = 36_000.0
Shares = NDArray[np.float64]


@functools.cache
def guarded(*, adapting: bool = False) -> Assembly:
    """Both sensors read the same output."""
    faults = {"protect": ["x1"], "protect_outside": OUTSIDE, "window": 64}
    config = sensed(REFERENCE, {"y1": 1.0, "y2": 1.0}, ATTENTIVE_S, **faults)
    return assembled(merged(config, {"adaptation": {}}) if adapting else config)


class Deaf:
    """Stands where the judge stands and excludes nobody."""

    def consider(self, engine: Engine) -> None:
        """Let the alarm be."""


def shares(
    bias: float, *, judged: bool, seed: int, adapting: bool = False, R: float = 1.0
) -> tuple[Shares, Shares]:
    """(RUNS,) share of each run's settled samples outside the level, and outside the same quantile of std alone.

    R: variance of the sensors' noise over the declared one.
    """
    assembly = guarded(adapting=adapting)
    engine, plant = assembly.engine(), plant_of(assembly.config.model_dump()).wrong(R=R)
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


@pytest.mark.parametrize("R", [1.0, 9.0])
@pytest.mark.parametrize("bias", [0.0, 2.0])
def test_nor_where_the_noise_is_estimated(bias: float, R: float) -> None:
    """The filters that leave a sensor out weigh the others by the same estimate, so the levels hold as they are.

    Of noise three times as large as declared the deviations alone, noise not estimated, are exceeded all the time.
    """
    given = {"judged": False, "seed": int(10 * bias + R), "R": R}
    assert lowest(shares(bias, adapting=True, **given)[0]) <= OUTSIDE
    if R > 1.0:
        assert lowest(shares(bias, **given)[1]) > 3.0 * OUTSIDE


def test_the_deviation_alone_would_not_have_held() -> None:
    """Under the same bias the filter's own deviation is exceeded far more often: the promise is not empty."""
    level, std = shares(2.0, judged=False, seed=20)
    assert lowest(std) > 3.0 * OUTSIDE
    assert np.mean(level) <= OUTSIDE


def test_a_replay_with_truth_counts_them_and_ends_with_the_last_level() -> None:
    """The summary's share is that of the reports, and `--json` shows it with the level of the last estimate."""
    assembly = guarded()
    plant = plant_of(assembly.config.model_dump())
    z, states = plant.run(np.random.default_rng(5), 1, STEPS)
    readings = readings_of(assembly, z)[0]
    reports = assembly.engine().process(readings).copy()
    values = states[0, :, :1] + 1.5 * np.sin(np.arange(STEPS))[:, None]  # a truth that is often far away
    truth = Truth(readings["t_ns"][1::2], ("x1",), values, np.zeros(1, np.bool_))
    said = replay(assembly.engine(), [readings], truth=truth).json_object()
    error = np.abs(reports["x"][:, 0] - np.repeat(values[:, 0], 2))
    assert said["outside"] == {"x1": np.mean(error > reports["protection"][:, 0])}
    assert 0.0 < said["outside"]["x1"] < 1.0
    assert said["final"]["protection"] == {"x1": reports["protection"][-1, 0]}
