"""Tests of how innovations scatter, repeat and hang together: noise, model, whiteness, frozen values."""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.numerics.kernel import kernel
from fusiond.types import Alarm, Kind

from .sizes import ADAPTS, SENSORS

VARIANCE, POOLED, WHITENESS, FROZEN = (
    int(Alarm.VARIANCE), int(Alarm.POOLED), int(Alarm.WHITENESS), int(Alarm.FROZEN),
)  # fmt: skip
NOISE = int(Kind.NOISE)
SENSOR_RATIO = 4.0
"""Innovation variances four times and a quarter of the expected one are tested for, sensor by sensor."""
POOLED_RATIO = 1.5
"""All sensors together are tested for half as much again, and for two thirds."""
CORRELATION = 0.3
"""Correlation of successive innovations that is tested for, either sign."""
SINGLE = 0.9
"""No single reading carries a test further than this share of its limit."""
LEARNT_AFTER = 20
"""Readings that changed before a run of equal values can be a fault: until then the sensor's manner is unknown."""
SHORT = 3
"""Of a longer run no more repeats are learnt: a fault must not become the sensor's manner."""
RARE = 0.02
"""Share of repeated values above which the sensor is quantised, so that a run is odd only while the state moves."""
MOVED = 5.0
"""Deviations of the noise by which the prediction must have moved for such a run to be odd."""


@kernel
def accumulate(llr: float, gain: float, limit: float) -> float:
    """One step of a CUSUM whose first step never suffices."""
    return max(0.0, llr + min(gain, SINGLE * limit))


@kernel
def ask(monitor: Any, alarm: int, sensor: int) -> None:
    """Ask for judgement, unless somebody has already."""
    if monitor.alarm == 0:
        monitor.alarm = alarm
        monitor.alarm_sensor = sensor


@kernel
def variance_gain(ratio: float, square: float, dof: int) -> float:
    """Log likelihood of a variance `ratio` times the expected one, given the sum of `dof` squares, over none."""
    return 0.5 * square * (1.0 - 1.0 / ratio) - 0.5 * dof * np.log(ratio)


@kernel
def test_scatter(track: Any, design: Any, work: Any, sensor: int, dof: int) -> None:
    """Variance of one sensor, of all sensors, and correlation of a sensor's successive innovations."""
    monitor, tests = track.monitor, design.tests
    square, product, last_square = 0.0, 0.0, 0.0
    for i in range(dof):
        e = work.tested[i]
        square += e * e
        product += e * monitor.last_e[sensor, i]
        last_square += monitor.last_e[sensor, i] * monitor.last_e[sensor, i]
        monitor.last_e[sensor, i] = min(max(e, -4.0), 4.0)
    for k in range(2):
        ratio = SENSOR_RATIO if k == 0 else 1.0 / SENSOR_RATIO
        limit = tests.variance_limit[sensor, k]
        monitor.variance[sensor, k] = accumulate(
            monitor.variance[sensor, k], variance_gain(ratio, square, dof), limit
        )
        known = ADAPTS > 0 and track.reaction.kind[sensor] == NOISE
        if k == 1 and not known and track.reaction.noise_excess[sensor] <= 0.0:
            monitor.variance[sensor, k] = 0.0  # less noise than declared is no fault, only the end of one
        if monitor.variance[sensor, k] >= limit:
            ask(monitor, VARIANCE, sensor)
            monitor.variance[sensor, k] = 0.0
        ratio = POOLED_RATIO if k == 0 else 1.0 / POOLED_RATIO
        limit = tests.pooled_limit[k]
        monitor.pooled[k] = accumulate(monitor.pooled[k], variance_gain(ratio, square, dof), limit)
        if monitor.pooled[k] >= limit:
            if monitor.alarm == 0:
                monitor.alarm_cell = k
            ask(monitor, POOLED, sensor)
            monitor.pooled[k] = 0.0
        slope = CORRELATION if k == 0 else -CORRELATION
        limit = tests.white_limit[sensor, k]
        gain = slope * product - 0.5 * slope * slope * last_square
        monitor.white[sensor, k] = accumulate(monitor.white[sensor, k], gain, limit)
        if monitor.white[sensor, k] >= limit:
            ask(monitor, WHITENESS, sensor)
            monitor.white[sensor, k] = 0.0


@kernel
def allowed_run(tests: Any, pairs: int, equal: int) -> int:
    """Equal values in a row beyond the first that the sensor's own manner of repeating itself explains."""
    share = max(equal / pairs, 1e-9)
    return max(2, int(np.ceil(tests.repeat_log / -np.log(min(share, 0.999)))))


@kernel
def note_value(track: Any, design: Any, reading: Any) -> None:
    """Note whether a reading is sent with the values of the one before: as it is sent, nothing taken off it."""
    monitor, sensor = track.monitor, reading.sensor
    monitor.repeats[sensor] = monitor.rests[sensor] = 1
    for i in range(design.length[sensor]):
        if monitor.raw_z[sensor, i] != reading.z[i]:
            monitor.repeats[sensor] = 0
        if reading.z[i] != 0.0:
            monitor.rests[sensor] = 0
        monitor.raw_z[sensor, i] = reading.z[i]


@kernel
def test_frozen(track: Any, design: Any, work: Any, sensor: int) -> None:
    """Whether the sensor repeats itself for longer than it ever does, or while the state it reads moves on."""
    monitor, tests = track.monitor, design.tests
    if monitor.rests[sensor]:  # exactly nothing, again and again, is what a wheel at rest says
        monitor.run[sensor] = 0
        return
    if not monitor.repeats[sensor]:
        repeated = min(monitor.run[sensor], SHORT)
        monitor.pairs[sensor] += 1 + repeated
        monitor.equal[sensor] += repeated
        monitor.run[sensor] = 0
        for i in range(design.dof[sensor]):
            monitor.run_h[sensor, i] = work.h[i]
        return
    monitor.run[sensor] += 1
    pairs, equal = monitor.pairs[sensor], monitor.equal[sensor]
    if pairs < LEARNT_AFTER or monitor.run[sensor] < allowed_run(tests, pairs, equal):
        return
    quantised = equal > RARE * pairs
    if quantised and (tests.is_input[sensor] or not moved(track, design, work, sensor)):
        return
    ask(monitor, FROZEN, sensor)


@kernel
def moved(track: Any, design: Any, work: Any, sensor: int) -> bool:
    """Whether what is predicted for the sensor has left what it was when its run of equal values began."""
    for i in range(design.dof[sensor]):
        away = abs(work.h[i] - track.monitor.run_h[sensor, i])
        if design.wraps[sensor, i]:
            away = min(away, abs(2.0 * np.pi - away))
        if away * away > MOVED * MOVED * design.R[sensor, i]:
            return True
    return False


@kernel
def clear_tests(track: Any) -> None:
    """Forget all evidence; what was learnt of the sensors' manner stays."""
    monitor = track.monitor
    monitor.alarm = 0
    monitor.llr[:] = 0.0
    monitor["count"][:] = 0
    monitor.phi[:] = 0.0
    monitor.variance[:] = 0.0
    monitor.pooled[:] = 0.0
    monitor.white[:] = 0.0
    monitor.last_e[:] = 0.0
    for sensor in range(SENSORS):
        monitor.run[sensor] = 0
