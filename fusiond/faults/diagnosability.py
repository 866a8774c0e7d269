"""What can be diagnosed at all: for every channel, input and kind of fault how small, how soon, against whom.

All of it follows from the running signatures w of a fault of unit size (`fusiond.faults.course`):

    information of a fault of size theta after n readings    theta^2 a(n) / 2,   a(n) = sum of w^2
    smallest size found within the longest wait              sqrt(2 ln(run length) / a(longest))
    expected delay of a larger one                           the n at which theta^2 a(n) / 2 = ln(run length)
    share of that information that no fault of sensor j has  1 - J_ij J_jj^-1 J_ji / J_ii   (sin^2 of the angle)

In steady state a(n) = n J_ii with J = Phi_y(0)^-1, the inverse of the readings' spectral density at zero frequency; the
share is, by the Schur complement, what would be left of the information if sensor j were taken out. Fault i can be told
from one of sensor j if and only if it shows without sensor j.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fusiond.faults.course import Course, Curve, Growth, Signatures, Suspect, signatures
from fusiond.faults.sizes import LONGEST, cumulative, delay_of
from fusiond.faults.thresholds import SAME, Promise, readings_between
from fusiond.types import Kind

TOLD_APART = 1.0 - SAME * SAME
"""Share of the information that tells two faults apart; with less their signatures correlate above SAME."""
GROWTH: dict[Kind, Growth] = {
    Kind.BIAS: "constant", Kind.DRIFT: "ramp", Kind.SCALE: "scale", Kind.DELAY: "delay",
}  # fmt: skip
"""How the error of each kind goes with time, for a size of one."""
STEPS = (1.0, 2.0, 4.0)
"""Sizes, over the smallest, whose expected delay is told."""


@dataclass(frozen=True, slots=True)
class Row:
    """One line of the diagnosability matrix.

    Args:
        suspect: where.   kind: of fault.
        first: information in the first reading, for a unit size.   steady: per reading in the long run.
        total: of all readings together; infinite while `steady` is not 0.
        smallest: size found within the longest wait, in the channel's unit (drift: per second; scale: a factor less
            one; delay: s; noise: a factor of the standard deviation); infinite: none.
        delays_s: (size, s) expected delays.   share: of the information that is left against the worst other sensor.
        ambiguous: numbers of the sensors it cannot be told from.   reason: what stands in the way, empty if nothing.
    """

    suspect: Suspect
    kind: Kind
    first: float
    steady: float
    total: float
    smallest: float
    delays_s: tuple[tuple[float, float], ...]
    share: float
    ambiguous: tuple[int, ...]
    reason: str


def shares_left(found: Signatures, i: int) -> dict[int, float]:
    """Share of suspect i's information that no constant fault of each other sensor has, by that sensor's number.

    A fault of the other sensor may have a size of its own in each of its channels.
    """
    suspects, shares = found.suspects, {}
    for sensor in sorted({one.sensor for one in suspects} - {suspects[i].sensor}):
        others = [j for j, one in enumerate(suspects) if one.sensor == sensor and found.total[j, j] > 0.0]
        J = found.products([i, *others])
        scale = np.sqrt(np.diagonal(J))
        shares[sensor] = 1.0
        if others and np.all(scale > 0.0):
            C = J / np.outer(scale, scale)
            explained = C[0, 1:] @ np.linalg.lstsq(C[1:, 1:], C[1:, 0], rcond=1e-9)[0]
            shares[sensor] = float(np.clip(1.0 - explained, 0.0, 1.0))
    return shares


def _reason(kind: Kind, curve: Curve, a_longest: float, moving: bool) -> str:
    """What stands in the way of finding it."""
    if a_longest <= 0.0:
        if kind in {Kind.SCALE, Kind.DELAY}:
            return "shows only while what it reads is not zero and moves; the trial motion never did"
        return "no reading depends on it"
    if kind in {Kind.SCALE, Kind.DELAY}:
        return (
            "sizes hold for the trial motion"
            if moving
            else "sizes hold for the trial state; nothing drives it"
        )
    if curve.steady <= 0.0:
        return "the state learns it: a smaller one leaves too little, however long one waits"
    return ""


def _signature_rows(
    course: Course, kind: Kind, found: Signatures, against: Signatures, runs: Sequence[float]
) -> list[Row]:
    """Rows of one kind that has a signature.

    Args:
        found: signatures of this kind.   against: those of constant faults.   runs: wanted readings of each suspect.
    """
    rows = []
    for i, suspect in enumerate(found.suspects):
        if suspect.is_input and kind in {Kind.SCALE, Kind.DELAY}:
            continue
        curve, log_run = found.curves[i][0], math.log(runs[i])
        a = cumulative(curve, len(curve.per_reading()) - 1 if kind is Kind.DRIFT else LONGEST)
        smallest = math.sqrt(2.0 * log_run / a[-1]) if a[-1] > 0.0 else math.inf
        delays = [
            (smallest * step, delay_of(a, 1.000001 * smallest * step, log_run) / curve.readings_per_s)
            for step in STEPS
            if math.isfinite(smallest)
        ]
        shares = shares_left(against, i)
        ambiguous = tuple(sensor for sensor, share in shares.items() if share < TOLD_APART)
        rows.append(
            Row(
                suspect, kind, float(a[0]), curve.steady,
                float(a[-1]) if curve.steady <= 0.0 else math.inf, smallest, tuple(delays),
                min(shares.values(), default=1.0), ambiguous, _reason(kind, curve, a[-1], course.moving),
            )
        )  # fmt: skip
    return rows


def smallest_noise(run: float, dof: int, readings: float) -> float:
    """Factor of the standard deviation that shows within so many readings: n dof (s - 1 - ln s) / 2 = ln(run)."""
    wanted = 2.0 * math.log(run) / (dof * readings)
    low, high = 1.0, 2.0 + wanted
    while high - 1.0 - math.log(high) < wanted:
        high *= 2.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if middle - 1.0 - math.log(middle) < wanted else (low, middle)
    return math.sqrt(high)


def _noise_row(course: Course, suspect: Suspect, curve: Curve, run: float, alone: bool) -> Row:
    """Noise of one updating sensor; with one sensor only it cannot be told from the model."""
    dof = int(course.dof[course.sensor == suspect.sensor][0])
    smallest = smallest_noise(run, dof, LONGEST)
    ratio = [(smallest * step) ** 2 for step in STEPS]
    readings = [2.0 * math.log(run) / (dof * (s - 1.0 - math.log(s))) for s in ratio]
    delays = tuple(
        (math.sqrt(s), max(n, 1.0) / curve.readings_per_s) for s, n in zip(ratio, readings, strict=True)
    )
    reason = "the only sensor: its noise and the model's disturbance look alike" if alone else ""
    return Row(suspect, Kind.NOISE, 0.0, 0.0, math.inf, smallest, delays, 1.0, (), reason)


def _plain_rows(suspect: Suspect, curve: Curve) -> list[Row]:
    """Faults that need no statistics: equal values, silence, what is no number."""
    period_s = 1.0 / curve.readings_per_s
    waits = {Kind.STUCK: 3.0 * period_s, Kind.SILENT: 2.5 * period_s, Kind.GARBAGE: 2.0 * period_s}
    return [
        Row(suspect, kind, 0.0, 0.0, math.inf, 0.0, ((0.0, wait_s),), 1.0, (), "")
        for kind, wait_s in waits.items()
    ]


def matrix(course: Course, found: Signatures, promise: Promise, tests: float) -> list[Row]:
    """The diagnosability matrix, suspect by suspect and kind by kind.

    Args:
        found: signatures of constant faults on this course.   tests: that share the promise.
    """
    runs = [readings_between(promise, tests, curves[0].readings_per_s) for curves in found.curves]
    rows = []
    for kind, growth in GROWTH.items():
        of_kind = found if growth == "constant" else signatures(course, found.suspects, growth)
        rows += _signature_rows(course, kind, of_kind, found, runs)
    updating = [suspect.sensor for suspect in found.suspects if not suspect.is_input]
    for i, suspect in enumerate(found.suspects):
        if not suspect.is_input and suspect.channel == 0:
            rows.append(_noise_row(course, suspect, found.curves[i][0], runs[i], len(set(updating)) == 1))
        if suspect.channel == 0:
            rows += _plain_rows(suspect, found.curves[i][0])
    return sorted(rows, key=lambda row: (row.suspect.sensor, row.suspect.channel, row.kind))
