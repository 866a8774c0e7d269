"""What could be told of a scale or a delay at all: by one who knows the fault, its size and its onset.

The readings put right (divided by the factor, stamped when they were measured) go through the filter without fault
detection; so do the readings as they came, and with the bias taken off that explains them best. The logarithm of their
likelihoods, sum of -(nis + ln det S) / 2, says by how much the truth is ahead of both. A fault that is ahead of none by
less than an alarm demands cannot be found at the promised interval; ahead of a bias by less than `FAMILY`, it cannot be
told from one.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fusiond.engine.engine import Engine
from fusiond.faults.kinds import FAMILY
from fusiond.types import NANOSECONDS, Kind
from tools.pages.trials import Records

TURNS = 2
"""Rounds in which the biases of several channels settle."""


@dataclass(frozen=True, slots=True)
class Lie:
    """One sensor's fault from an onset on.

    Args:
        size: scale: the factor;   delay: s.   channels: that err.
    """

    sensor: int
    kind: Kind
    size: float
    onset_ns: int
    channels: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Lead:
    """Log likelihood by which the truth is ahead of no fault, and of the best bias."""

    of_none: float
    of_bias: float

    def tells(self, interval_s: float, rate_hz: float) -> bool:
        """Whether it can be found at one false alarm in `interval_s`, and told from a bias."""
        return self.of_none >= math.log(interval_s * rate_hz) and self.of_bias >= FAMILY


def likelihood(engine: Engine, readings: Records) -> float:
    """Log likelihood of readings, in the order of their stamps, but for a constant."""
    engine.reset()
    reports = engine.process(readings[np.lexsort((readings["sensor"], readings["t_ns"]))])
    S = np.where(reports["S"] > 0.0, reports["S"], 1.0)
    return -0.5 * float(np.sum(reports["nis"]) + np.sum(np.log(S)))


def lead(engine: Engine, readings: Records, lie: Lie, steps: tuple[float, ...]) -> Lead:
    """By how much the truth is ahead.

    Args:
        engine: without fault detection.   readings: with the lie in them.
        steps: of each channel, a bias well within what its readings show.
    """
    own = (readings["sensor"] == lie.sensor) & (readings["t_ns"] >= lie.onset_ns)
    right = readings.copy()
    stretched = 0.0
    if lie.kind is Kind.DELAY:
        right["t_ns"][own] -= round(lie.size * NANOSECONDS)
    else:
        for channel in lie.channels:
            right["z"][own, channel] /= lie.size
        stretched = float(np.sum(own)) * len(lie.channels) * math.log(lie.size)
    true = likelihood(engine, right) - stretched
    biased = readings.copy()
    for _ in range(TURNS):
        for channel in lie.channels:

            def shifted(by: float, channel: int = channel) -> float:
                moved = biased.copy()
                moved["z"][own, channel] -= by
                return likelihood(engine, moved)

            biased["z"][own, channel] -= peak(shifted, steps[channel])
    return Lead(true - likelihood(engine, readings), true - likelihood(engine, biased))


def peak(function: Callable[[float], float], step: float) -> float:
    """Where a parabola through -step, 0 and step is largest; 0 where it has no largest value."""
    below, here, above = function(-step), function(0.0), function(step)
    curvature = below - 2.0 * here + above
    return 0.5 * step * (below - above) / curvature if curvature < 0.0 else 0.0
