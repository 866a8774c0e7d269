"""From one promise to every threshold: the tests of a configuration, designed on its healthy course.

`detection_of` is called at every start; what it derives is a plain table that `engine` copies into its design record.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from fusiond.assembly.course import course_of, rate_hz
from fusiond.assembly.moving import TESTS_EACH, MovingCell, moving_cells, moving_sensors
from fusiond.assembly.resolve import Resolved, by_key
from fusiond.config import FaultsSection
from fusiond.engine.layout import Layout
from fusiond.faults.course import Course, Curve, Signatures, Suspect, signatures
from fusiond.faults.sizes import LONGEST, Ladder, ladder
from fusiond.faults.thresholds import (
    GATE_SHARE,
    Promise,
    alone,
    independent,
    readings_between,
    whiteness_threshold,
)
from fusiond.numerics import scatter_cusum
from fusiond.numerics.restart import Profile, threshold
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Kind, Role

Integers = NDArray[np.int64]

COLUMNS = ("sensor", "channel", "is_input", "kind", "theta", "tolerance", "h", "age")
"""What is known of each cell."""
SENSOR_RATIO, POOLED_RATIO = 4.0, 1.5
"""Variance ratios tested for, sensor by sensor and all together; their inverses too."""


SLOWEST, MOST = 64, 2048
"""The window holds so many readings of its slowest sensor, and at most so many in all."""


@dataclass(frozen=True, slots=True)
class Detection:
    """Every test's numbers; s sensors (inputs included), c cells sorted by sensor.

    Args:
        promise: what they were derived from.   window: readings of evidence kept.
        tests: number of tests the promise is shared among, the merged once.
        cell_sensor, cell_channel, cell_is_input: (c,) what a cell suspects; channel of the reading (-1: all of them),
          or process input.   cell_kind: (c,) types.Kind, a bias, a scale or a delay.
        cell_theta: (c,) signed size, in the channel's or the input's unit.   cell_tolerance: error that is no fault.
          cell_h: (c,) limit of its llr.
        cell_age: (c,) readings of its sensor (any readings, for an input) after which its signature starts anew.
        first, last: (s,) cells of each sensor.   variance_h, white_h: (s, 2) up, down;   pooled_h: (2,).
        gate: (s,) largest nis that is used.   repeat_log: log of the readings between false alarms of frozen tests.
        dead_band, studentise: (s,) see `Promise`.
        course, signatures: what they were derived from, for the diagnosability matrix.
        ladders: of each suspect.
    """

    promise: Promise
    window: int
    tests: float
    cell_sensor: Integers
    cell_channel: Integers
    cell_is_input: NDArray[np.bool_]
    cell_kind: Integers
    cell_theta: Vector
    cell_tolerance: Vector
    cell_h: Vector
    cell_age: Integers
    first: Integers
    last: Integers
    variance_h: Matrix
    white_h: Matrix
    pooled_h: Vector
    gate: Vector
    repeat_log: float
    dead_band: Vector
    studentise: Vector
    course: Course
    signatures: Signatures
    ladders: tuple[Ladder, ...]

    @property
    def cells(self) -> int:
        """Number of cells."""
        return len(self.cell_theta)


def suspects_of(resolved: Resolved) -> tuple[Suspect, ...]:
    """Every measured channel of every updating sensor, every driven input, in the order of the sensors."""
    found = []
    for number, sensor in enumerate(resolved.sensors):
        if sensor.role is Role.UPDATE:
            found += [Suspect(number, channel, False) for channel in range(sensor.model.dof)]
        elif sensor.role is Role.INPUT:
            found += [Suspect(number, driven, True) for driven in sensor.drives]
    return tuple(found)


def tolerance_of(resolved: Resolved, suspect: Suspect) -> float:
    """Lasting error of a suspect that the operator calls none, in its unit; raises ConfigError."""
    sensor = resolved.sensors[suspect.sensor]
    if sensor.section is None:
        return 0.0
    stated = by_key(sensor.section.tolerance, sensor.model.channels, f"sensor.{sensor.name}.tolerance")
    place = sensor.drives.index(suspect.channel) if suspect.is_input else suspect.channel
    return float(stated.get(sensor.model.channels[place].name, 0.0))


def _profile(curve: Curve, ladder_: Ladder, age: float) -> Profile:
    """The curve as the cell of one size lives it: cut at its age where it fades, settled behind its end otherwise."""
    alive = np.cumsum(curve.own) <= age if ladder_.finite else np.ones(len(curve.own), dtype=bool)
    pattern = 0 if ladder_.finite else curve.pattern
    return Profile(curve.information[alive], curve.own[alive].astype(float), pattern)


def _distinct(curves: tuple[Curve, ...]) -> list[Curve]:
    """The curves that differ; onsets of one regular pattern mostly give the same."""
    kept: list[Curve] = []
    for curve in curves:
        head = curve.information[:64]
        if not any(
            len(head) == len(other.information[:64]) and np.allclose(head, other.information[:64], rtol=0.02)
            for other in kept
        ):
            kept.append(curve)
    return kept


def _cells(
    found: Signatures,
    ladders: list[Ladder],
    promise: Promise,
    tests: float,
    together: Vector,
    tolerated: list[float],
) -> dict[str, list[float]]:
    """Cells of every suspect, sizes ascending, each positive then negative."""
    columns: dict[str, list[float]] = {name: [] for name in COLUMNS}
    known: dict[tuple[float, ...], float] = {}
    for i, (suspect, steps) in enumerate(zip(found.suspects, ladders, strict=True)):
        curves = _distinct(found.curves[i])
        for size, age, share in zip(steps.sizes, steps.ages, steps.shares, strict=True):
            wanted = readings_between(promise, tests, curves[0].readings_per_s, share)
            profiles = [_profile(curve, steps, age) for curve in curves]
            heads = np.concatenate([p.information[:40] * size**2 for p in profiles])
            key = (*(float(value) for value in np.round(heads, 3)), wanted)
            if key not in known:
                known[key] = threshold(profiles, float(size), wanted, promise.dead_band)
            for sign in (1.0, -1.0):
                values = (
                    suspect.sensor, suspect.channel, suspect.is_input, Kind.BIAS, sign * size, tolerated[i],
                    known[key], round(age * together[i]),
                )  # fmt: skip
                for name, value in zip(COLUMNS, values, strict=True):
                    columns[name].append(value)
    return columns


def _with_moving(columns: dict[str, list[float]], cells: list[MovingCell]) -> dict[str, NDArray[np.float64]]:
    """The columns of all cells, sorted by sensor."""
    for cell in cells:
        values = (cell.sensor, -1, False, cell.kind, cell.theta, 0.0, cell.h, LONGEST)
        for name, value in zip(COLUMNS, values, strict=True):
            columns[name].append(value)
    order = np.argsort(columns["sensor"], kind="stable")
    return {name: np.array(values, dtype=np.float64)[order] for name, values in columns.items()}


def _scatter(resolved: Resolved, promise: Promise, tests: float) -> tuple[Matrix, Matrix, Vector]:
    """Thresholds of variance and whiteness (s, 2), and of the pooled variance (2,)."""
    s = len(resolved.sensors)
    variance, white = np.full((s, 2), np.inf), np.full((s, 2), np.inf)
    dofs: dict[int, float] = {}
    for number, sensor in enumerate(resolved.sensors):
        if sensor.role is not Role.UPDATE:
            continue
        rate, dof = rate_hz(resolved, sensor), sensor.model.dof
        wanted = readings_between(promise, tests, rate)
        dofs[dof] = dofs.get(dof, 0.0) + rate
        for k, ratio in enumerate((SENSOR_RATIO, 1.0 / SENSOR_RATIO)):
            variance[number, k] = scatter_cusum.threshold(
                wanted, scatter_cusum.increment_law(ratio, {dof: 1.0})
            )
        white[number] = whiteness_threshold(wanted, dof)
    wanted = readings_between(promise, tests, sum(dofs.values()))
    pooled = [
        scatter_cusum.threshold(wanted, scatter_cusum.increment_law(ratio, dofs))
        for ratio in (POOLED_RATIO, 1.0 / POOLED_RATIO)
    ]
    return variance, white, np.array(pooled)


def count_tests(found: Signatures, ladders: list[Ladder], updating: int) -> float:
    """Independent tests the promise is shared among.

    The cells, those that alarm together counted once; two for the variance and two for the whiteness of each updating
    sensor; two for the pooled variance, and one for all values that freeze (continuous ones never do).
    """
    counts = independent(found.correlation())
    cells = sum(
        float(count) * 2.0 * float(steps.shares.sum()) * alone(len(steps.sizes), steps.finite)
        for count, steps in zip(counts, ladders, strict=True)
    )
    return cells + 4.0 * updating + 3.0


def window_of(resolved: Resolved) -> int:
    """Readings the window holds: of the slowest sensor SLOWEST of them.

    Where lasting errors are tolerated no more than configured: for longer, a tolerated error wanders as a fault does.
    """
    least = (resolved.config.faults or FaultsSection()).window
    if any(tolerance_of(resolved, suspect) > 0.0 for suspect in suspects_of(resolved)):
        return least
    rates = [rate_hz(resolved, sensor) for sensor in resolved.updating]
    return max(least, min(math.ceil(SLOWEST / min(rates) * sum(rates)), MOST))


def detection_of(resolved: Resolved, layout: Layout, promise: Promise) -> Detection:
    """Design every test of a configuration.

    Args:
        layout: its records (`layout_of`).   promise: `Promise(interval_s, dead_band, studentise)`.
    """
    course = course_of(resolved)
    suspects = suspects_of(resolved)
    found = signatures(course, suspects)
    updating = len(resolved.updating)
    guess = 8.0 * len(suspects) + 4.0 * updating + 3.0
    tolerated = [tolerance_of(resolved, suspect) for suspect in suspects]
    ladders = [
        ladder(curves[0], readings_between(promise, guess, curves[0].readings_per_s), blind)
        for curves, blind in zip(found.curves, tolerated, strict=True)
    ]
    window = window_of(resolved)
    window_s = window / sum(rate_hz(resolved, sensor) for sensor in resolved.updating)
    moving = moving_sensors(resolved, dict(zip(suspects, tolerated, strict=True)), window_s)
    tests = count_tests(found, ladders, updating) + TESTS_EACH * len(moving)
    rates = np.array([rate_hz(resolved, resolved.sensors[suspect.sensor]) for suspect in suspects])
    total_rate = sum(rate_hz(resolved, sensor) for sensor in resolved.updating)
    together = np.array(
        [
            (total_rate if suspect.is_input else rate) / found.curves[i][0].readings_per_s
            for i, (suspect, rate) in enumerate(zip(suspects, rates, strict=True))
        ]
    )
    columns = _with_moving(
        _cells(found, ladders, promise, tests, np.maximum(together, 1.0), tolerated),
        moving_cells(resolved, course, moving, promise, tests),
    )
    sensor = columns["sensor"].astype(np.int64)
    s = len(layout.sensors)
    variance, white, pooled = _scatter(resolved, promise, tests)
    dof = np.array([one.model.dof for one in resolved.sensors])
    gate = np.where([one.role is Role.UPDATE for one in resolved.sensors], chi2.isf(GATE_SHARE, dof), 0.0)
    return Detection(
        promise=promise,
        window=window,
        tests=tests,
        cell_sensor=sensor,
        cell_channel=columns["channel"].astype(np.int64),
        cell_is_input=columns["is_input"].astype(bool),
        cell_kind=columns["kind"].astype(np.int64),
        cell_theta=columns["theta"],
        cell_tolerance=columns["tolerance"],
        cell_h=columns["h"],
        cell_age=columns["age"].astype(np.int64),
        first=np.searchsorted(sensor, np.arange(s), "left"),
        last=np.searchsorted(sensor, np.arange(s), "right"),
        variance_h=variance,
        white_h=white,
        pooled_h=pooled,
        gate=gate,
        repeat_log=math.log(readings_between(promise, tests, total_rate)),
        dead_band=np.full(s, promise.dead_band),
        studentise=np.full(s, promise.studentise),
        course=course,
        signatures=found,
        ladders=tuple(ladders),
    )
