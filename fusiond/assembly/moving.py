"""Cells for errors that grow with the motion: a scale, which errs by h, and a delay, by minus the rate of change of h.

Such an error looks like a bias as long as the machine goes on as it does; where it turns to and fro, no bias does.
How much of it shows is decided by the motion, which nobody knows at design time. So the threshold is the one that holds
whatever the course of the information: a CUSUM of log likelihood ratios runs exp(threshold) readings to a false alarm
at least (Lorden 1971). Only the sizes are taken from the trial motion, two for each sign, wide apart.

A plant whose matrices never change has none: nothing drives what it reads away from where it was linearised. Nor has a
sensor with a tolerated error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fusiond.assembly.course import rate_hz
from fusiond.assembly.resolve import Resolved
from fusiond.assembly.trial import Trial, irregular
from fusiond.faults.course import Course, Growth, Suspect, signatures
from fusiond.faults.sizes import LONGEST, cumulative
from fusiond.faults.thresholds import Promise, readings_between
from fusiond.types import Kind

GROWTHS: dict[Kind, Growth] = {Kind.SCALE: "scale", Kind.DELAY: "delay"}
OVER = (2.0, 8.0)
"""Sizes over the smallest that the trial motion shows within the longest wait."""
LARGEST_SCALE = 0.5
"""No cell looks for a larger relative error."""
SHORTEST_S = 5.0
"""Evidence of a shorter time cannot tell these errors from a bias: an alarm could only be misjudged."""
TESTS_EACH = 2.0
"""Tests of the usual kind that a sensor's cells are worth: they run longer to an alarm than their threshold says."""


@dataclass(frozen=True, slots=True)
class MovingCell:
    """One cell: all channels of a sensor err by one size; h: limit of its llr."""

    sensor: int
    kind: Kind
    theta: float
    h: float


def is_stationary(resolved: Resolved) -> bool:
    """Whether neither the model nor what any sensor sees of it depends on the state."""
    if not resolved.process.linear:
        return False
    trial = Trial(resolved)
    here, there = trial.start(), trial.shift(trial.start(), irregular(len(resolved.process.error_slots)))
    return all(
        np.array_equal(trial.look(sensor, here)[1], trial.look(sensor, there)[1])
        for sensor in resolved.updating
    )


def moving_sensors(resolved: Resolved, tolerated: dict[Suspect, float], window_s: float) -> list[int]:
    """Numbers of the sensors that get such cells; none where evidence is kept for too short a time to show motion."""
    if is_stationary(resolved) or window_s < SHORTEST_S:
        return []
    allowed = {suspect.sensor for suspect, limit in tolerated.items() if limit > 0.0}
    numbers = [k for k, sensor in enumerate(resolved.sensors) if sensor in resolved.updating]
    return [k for k in numbers if k not in allowed]


def moving_cells(
    resolved: Resolved, course: Course, sensors: list[int], promise: Promise, tests: float
) -> list[MovingCell]:
    """The cells of these sensors, each size positive, then negative."""
    cells = []
    suspects = tuple(Suspect(k, c, False) for k in sensors for c in range(resolved.sensors[k].model.dof))
    for kind, growth in GROWTHS.items():
        found = signatures(course, suspects, growth)
        for k in sensors:
            own = [found.curves[i][0] for i, suspect in enumerate(suspects) if suspect.sensor == k]
            total = sum(float(cumulative(curve, LONGEST)[-1]) for curve in own)
            h = math.log(readings_between(promise, tests, rate_hz(resolved, resolved.sensors[k])))
            if total <= 0.0:
                continue
            smallest = math.sqrt(2.0 * h / total)
            for size in (smallest * step for step in OVER):
                if kind is Kind.DELAY or size < LARGEST_SCALE:
                    cells += [MovingCell(k, kind, sign * size, h) for sign in (1.0, -1.0)]
    return cells
