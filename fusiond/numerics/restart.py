"""Average run length of a CUSUM whose shift changes with its age: a signature that starts anew with every restart.

The statistic starts at 0 with age 0; its k-th reading adds a normal step whose law depends on k; it starts anew at
L <= 0 and after its greatest age, and raises the alarm at L >= h. Every start is like every other, so (renewal)

    average run length = readings of one cycle / probability that a cycle ends in the alarm,

and one cycle is a density on (0, h) carried from reading to reading. Once the signature has settled the rest of the
cycle is the resolvent of a step that no longer changes. The point mass at 0 of the ordinary CUSUM never appears. The
grid is uniform (one step is a convolution), the integral Gregory's, of fourth order.

Test: tests/calibration/test_cusum.py (equal to the exact CUSUM where the shift is constant, to Monte Carlo elsewhere).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import toeplitz
from scipy.special import ndtr

from fusiond.numerics.cusum import Steps
from fusiond.numerics.ud import Vector

FINEST = 60.0
"""Steps narrower than the threshold over this are taken together with the next ones."""
PER_STEP = 2.5
"""Grid points a standard deviation of the narrowest step."""
EXPLICIT = 60
"""Steps followed one by one; what is left by then is taken for settled."""
GONE = 1e-4
"""Share of cycles still running, of those that raised the alarm, at which the rest no longer matters."""
SMALLEST = 1.0
"""No threshold is lower: an alarm needs evidence even where its promise would not."""
CLOSE = 0.15
"""Error of the logarithm of the run length from which one last step, of slope one, suffices."""


@dataclass(frozen=True, slots=True)
class Profile:
    """Shifts of one signature, for a fault of unit size, reading by reading of a cycle.

    Args:
        information: (k,) squared whitened shift of each reading.   counts: (k,) whether it counts for the run length.
        pattern: so many of the last readings repeat for ever; 0 where the cycle ends after the last one.
    """

    information: Vector
    counts: Vector
    pattern: int


@dataclass(frozen=True, slots=True)
class _Step:
    """One or several readings taken as one normal increment."""

    law: Steps
    counts: float


def _law(variances: Vector, dead_band: float) -> tuple[Vector, Vector]:
    """Mean and variance of each reading's increment, from its squared shift."""
    shifts = np.sqrt(variances)
    beyond = np.maximum(shifts - dead_band, 0.0)
    return -0.5 * beyond * (shifts + dead_band), beyond * beyond


def _steps(profile: Profile, size: float, dead_band: float, narrowest: float) -> list[_Step]:
    """The cycle's first steps, those too narrow for the grid put together."""
    means, variances = _law(profile.information * size**2, dead_band)
    rows = zip(means.tolist(), variances.tolist(), profile.counts.tolist(), strict=True)
    steps: list[_Step] = []
    mean = variance = counts = 0.0
    for more_mean, more_variance, more_counts in rows:
        mean, variance, counts = mean + more_mean, variance + more_variance, counts + more_counts
        if variance >= narrowest**2:
            steps.append(_Step(Steps(mean, math.sqrt(variance)), counts))
            mean = variance = counts = 0.0
            if len(steps) >= EXPLICIT:
                break
    if not steps and variance > 0.0:
        steps.append(_Step(Steps(mean, math.sqrt(variance)), counts))
    return steps


def _tail(profile: Profile, size: float, dead_band: float, narrowest: float) -> _Step | None:
    """One step of the settled signature, wide enough for the grid; None where the cycle ends instead."""
    if profile.pattern == 0:
        return None
    means, variances = _law(profile.information[-profile.pattern :] * size**2, dead_band)
    variance = float(variances.mean())
    if variance <= 0.0:
        return None
    together = max(1, math.ceil(narrowest**2 / variance))
    law = Steps(together * float(means.mean()), math.sqrt(together * variance))
    return _Step(law, together * float(profile.counts[-profile.pattern :].mean()))


def _grid(threshold: float, width: float) -> tuple[Vector, Vector]:
    """Uniform points of [0, h] and Gregory's weights (fourth order), fine enough for densities of this width."""
    count = 12 + math.ceil(PER_STEP * threshold / width)
    points = np.linspace(0.0, threshold, count)
    weights = np.full(count, threshold / (count - 1))
    weights[:3] *= (3.0 / 8.0, 7.0 / 6.0, 23.0 / 24.0)
    weights[-3:] *= (23.0 / 24.0, 7.0 / 6.0, 3.0 / 8.0)
    return points, weights


def _density(differences: Vector, law: Steps) -> Vector:
    """Normal density of a step."""
    z = (differences - law.mean) / law.std
    density: Vector = np.exp(-0.5 * z * z) * (0.3989422804014327 / law.std)
    return density


def _over(points: Vector, threshold: float, law: Steps) -> Vector:
    """Probability that the next step from each point reaches the threshold."""
    over: Vector = ndtr((points + law.mean - threshold) / law.std)
    return over


def cycle(profile: Profile, size: float, threshold: float, dead_band: float = 0.0) -> tuple[float, float]:
    """Counted readings of one cycle, on average, and the probability that it ends in the alarm.

    Args:
        size: of the fault tested for, in the profile's unit, > 0.
    """
    narrowest = threshold / FINEST
    steps = _steps(profile, size, dead_band, narrowest)
    tail = _tail(profile, size, dead_band, narrowest)
    if not steps or steps[0].law.std < narrowest:
        return 1.0, 0.0
    points, weights = _grid(
        threshold, min(step.law.std for step in [*steps[1:], *([tail] if tail else []), steps[0]])
    )
    first = steps[0].law
    alive = _density(points, first) * weights
    alarm, length = float(_over(np.zeros(1), threshold, first)[0]), steps[0].counts
    lattice = np.concatenate((-points[:0:-1], points))
    for step in steps[1:]:
        share = float(alive.sum())
        if share <= GONE * alarm:
            return length, alarm
        length += step.counts * share
        alarm += float(alive @ _over(points, threshold, step.law))
        alive = np.convolve(_density(lattice, step.law), alive, "valid") * weights
    if tail is None:
        # the last readings add nothing any more, but those cycles that are left wait for their end
        length += float(alive.sum()) * (float(profile.counts.sum()) - sum(step.counts for step in steps))
    else:
        moves = _density(lattice, tail.law)
        middle = len(points) - 1
        kernel = toeplitz(moves[middle:], moves[middle::-1]) * weights[:, None]
        left = np.linalg.solve(np.eye(len(points)) - kernel, alive)
        length += tail.counts * float(left.sum())
        alarm += float(left @ _over(points, threshold, tail.law))
    return length, alarm


def run_length(profiles: Sequence[Profile], size: float, threshold: float, dead_band: float = 0.0) -> float:
    """Mean number of counted readings between alarms while nothing is wrong; infinite where there can be none.

    Args:
        profiles: of cycles that begin at different places of the sensors' pattern, each as often as the others.
        size, threshold, dead_band: as in `cycle`.
    """
    cycles = [cycle(profile, size, threshold, dead_band) for profile in profiles]
    alarm = sum(probability for _, probability in cycles)
    return sum(length for length, _ in cycles) / alarm if alarm > 0.0 else math.inf


def threshold(profiles: Sequence[Profile], size: float, wanted: float, dead_band: float = 0.0) -> float:
    """Threshold of one size with this average run length in counted readings; at least SMALLEST.

    Args:
        profiles: as in `run_length`.
    """
    target = math.log(wanted)
    low, high = SMALLEST, target + 3.0
    h = max(target - 2.2, 2.0 * SMALLEST)
    before: tuple[float, float] | None = None
    for _ in range(12):
        error = math.log(run_length(profiles, size, h, dead_band)) - target
        slope = 1.0
        if before is not None and math.isfinite(error) and abs(h - before[0]) > 1e-3:
            slope = min(max((error - before[1]) / (h - before[0]), 0.5), 5.0)
        newton = h - error / slope
        if abs(error) < CLOSE or high - low < 0.1 * CLOSE:
            return max(newton if low < newton < high else h, SMALLEST)
        low, high = (low, h) if error > 0.0 else (h, high)
        if math.isfinite(error):
            before = (h, error)
        h = newton if low < newton < high else 0.5 * (low + high)
    return max(h, SMALLEST)
