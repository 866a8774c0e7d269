"""A noise that is declared too large: no fault, and not worth asking about again and again."""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np
import pytest

import fusiond.engine.judge as judging
from fusiond.assembly.assembly import Assembly, assemble
from fusiond.engine.judge import CALM_WINDOWS, LEAST
from tests.scenarios.faults.drive import scene
from tools.pages.trials import CONFIGS

SECONDS, ONSET_S = 150.0, 120.0


def test_a_cautious_noise_is_judged_ever_more_rarely_and_hides_no_bias(monkeypatch):
    """Thrice the deviation there is: asked about as often as doublings allow; a bias of y2 is named at once."""
    # GIVEN three sensors whose noise is a third of what was declared, and a bias of six declared deviations at 120 s
    stage = dataclasses.replace(scene("three_positions"), options=(("R", (0.001, 0.001, 0.001)),))
    asked, isolate = [], judging.isolate

    def counted(seen, *rest, **more):
        asked.append(int(seen.t_ns[-1]))
        return isolate(seen, *rest, **more)

    monkeypatch.setattr(judging, "isolate", counted)
    run = stage.drive(SECONDS, [f"y2.bias=0.6@{ONSET_S:.0f}"])

    # THEN the judge is asked some times first, at intervals that double up to the longest, and of nobody else
    early = [t_ns for t_ns in asked if t_ns < ONSET_S * 1e9]
    window = stage.layout.shape.window
    doublings = math.ceil(math.log2(CALM_WINDOWS * window / (LEAST * max(1, window // judging.STEPS))))
    assert 2 <= len(early) <= doublings + math.ceil(3 * 10 * ONSET_S / (CALM_WINDOWS * window))
    assert run.named("y2").at_s <= ONSET_S + 0.2, run.story()
    assert not run.blamed("y1"), run.story()
    assert not run.blamed("y3"), run.story()
    assert run.turns("y2")[0].at_s >= ONSET_S, run.story()


@functools.cache
def robust() -> Assembly:
    """Three positions with a noise of 0.1 each, under the profile that doubts it."""
    config = scene("three_positions").assembly.config
    doubting = config.faults.model_copy(update={"profile": "robust"})
    return assemble(config.model_copy(update={"faults": doubting}), CONFIGS)


@pytest.mark.parametrize(("wander", "at_least", "at_most"), [(0.05, 0, 0), (0.2, 1, 50)])
def test_errors_that_readings_share_within_a_cautious_noise_are_not_asked_about(
    monkeypatch, wander, at_least, at_most
):
    """A noise of a tenth of the declared one, and a slow error of y2 beside it: half a deviation, or two."""
    # GIVEN readings of y2 that go half the declared deviation to and fro in 20 s, or two of them
    stage = dataclasses.replace(scene("three_positions"), options=(("R", (1e-4, 1e-4, 1e-4)),))
    log = stage.clean(SECONDS, seed=3)
    own = log["sensor"] == stage.layout.numbers["y2"]
    log["z"][own, 0] += wander * np.sin(log["t_ns"][own] * (1e-9 * 2.0 * np.pi / 20.0))
    asked, weigh = [], judging.Judge._weigh

    def counted(judge, reactions, alarm, *rest):
        asked.append(alarm)
        return weigh(judge, reactions, alarm, *rest)

    monkeypatch.setattr(judging.Judge, "_weigh", counted)
    robust().engine().process(log)

    # THEN nobody asks about what the declared noise covers, and somebody does about what it does not
    assert at_least <= len(asked) <= at_most
