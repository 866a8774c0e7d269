"""Has an error that is taken off a sensor's readings ended? A hypothesis beside all others, whose size is known.

Once the error has gone, whatever is still taken off is itself an error of the corrected readings: with o and d t, gain
1 + g and lag l taken off,

    f = (h - o - d t) / (1 + g) - h + l dh/dt,

of the size c = 1, or as near to it as the error was known: c ~ N(1, v). With w(o) the whitened means of f from onset o
on, a = w'w, b = w'e, the log likelihood ratio against no change is

    [b^2 v + 2 b - a] / (2 (1 + a v)) - ln(1 + a v) / 2.

No other explanation of those innovations has so little left to choose, so it need only be as good as any other.

Source: Bayes' rule for a normal size. Law: tests/laws/test_ending.py.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fusiond.faults.course import Suspect
from fusiond.faults.ground import ground_of, information
from fusiond.faults.hypotheses import Hypothesis
from fusiond.faults.response import Response
from fusiond.numerics.ud import Matrix
from fusiond.types import Kind


@dataclass(frozen=True, slots=True)
class Ending:
    """The most likely end of an error: the window's entry, and its log likelihood ratio less what the onset costs."""

    onset: int
    score: float


def find_ending(
    response: Response, sensor: int, inputs: tuple[int, ...], left: Matrix, unsure: float
) -> Ending | None:
    """The most likely end of what is taken off a sensor; None where the window has nothing of it.

    Args:
        inputs: numbers of the process inputs it drives; none where it updates.
        left: (W, m) error of its corrected readings, raw channels, once the error has gone; (W, k) of inputs.
        unsure: deviation of the error taken off, as a share of it.
    """
    ground = ground_of(replace(response, h=left), (sensor,), inputs)
    if not len(ground.entries):
        return None
    channels = inputs or tuple(range(left.shape[1]))
    part = tuple(Suspect(sensor, channel, bool(inputs)) for channel in channels)
    each = Hypothesis(Kind.SCALE, (part,))  # "scales" with what stands in the place of h: the error left
    a, b = (found.reshape(len(ground.entries)) for found in information(ground, each))
    v = unsure**2
    score = (b * b * v + 2.0 * b - a) / (2.0 * (1.0 + a * v)) - 0.5 * np.log1p(a * v)
    best = int(np.argmax(score))
    return Ending(int(ground.entries[best]), float(score[best]) - math.log(len(score)))
