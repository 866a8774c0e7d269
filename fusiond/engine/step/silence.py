"""Silence: how long a sensor may say nothing, and how long it must then speak to be believed steady.

With fault detection the deadline is learnt: two and a half periods, or the gap that the stream exceeds no more often
than promised. Gaps of more than LATE deadlines are late ones; how much longer than that they are is taken to be
exponential (lost readings make it geometric), so that two in a row tell how rare four are:

    P(gap > LATE + g) = share exp(-g / excess)

A stream that breaks off again and again stays silent until it has spoken for STEADY times its first deadline without
a break. Source of the tail: Pickands 1975, "Statistical inference using extreme order statistics".
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.numerics.kernel import kernel

from .sizes import STEADY

LATE = 0.6
"""A gap of this many first deadlines, one and a half periods, is a late one."""
MEMORY = 1000
"""Gaps over which the share of late ones is learnt."""
LATE_MEMORY = 100
"""Late gaps over which their length is learnt."""
ENOUGH = 10
"""Late gaps that must have been seen before a stream is taken for one that has them."""
BROKEN = 4
"""A tail is believed up to so many first deadlines; a stream not yet steady again is broken by a gap of that length."""
USUAL = 2
"""Beyond that up to so many usual late gaps: a stream may come in bursts, or more slowly than it says."""
HELD_BACK_NS = 50_000_000
"""A live stream's readings may come this much later than the time that has passed elsewhere says."""


@kernel
def deadline_ns(track: Any, design: Any, sensor: int) -> int:
    """Longest healthy silence of a sensor; 0 where none is judged."""
    first = design.silence_ns[sensor]
    if STEADY == 0 or first == 0 or design.promised_gaps[sensor] == 0.0:
        return int(first)
    limit = first
    if track.late_gaps[sensor] >= ENOUGH:
        late, excess = LATE * first, track.late_excess_ns[sensor]
        tail = late + excess * np.log(track.late_share[sensor] * design.promised_gaps[sensor])
        limit = max(limit, int(min(tail, max(BROKEN * first, USUAL * (late + excess)))))
    return int(max(limit, HELD_BACK_NS) if track.live[sensor] else limit)


@kernel
def learn_gap(track: Any, design: Any, sensor: int, gap_ns: int, limit_ns: int) -> None:
    """Learn how often readings come late, and by how much."""
    late_ns = LATE * design.silence_ns[sensor]
    late = gap_ns > late_ns
    track.gaps[sensor] = min(track.gaps[sensor] + 1, MEMORY)
    track.late_share[sensor] += ((1.0 if late else 0.0) - track.late_share[sensor]) / track.gaps[sensor]
    if late:
        track.late_gaps[sensor] = min(track.late_gaps[sensor] + 1, LATE_MEMORY)
        excess_ns = min(gap_ns, 2 * limit_ns) - late_ns
        track.late_excess_ns[sensor] += (excess_ns - track.late_excess_ns[sensor]) / track.late_gaps[sensor]


@kernel
def unsteady(track: Any, design: Any, sensor: int, now_ns: int) -> bool:
    """Whether the sensor's last silence is too recent for it to be believed steady."""
    ended_ns = track.gap_to_ns[sensor]
    return bool(STEADY > 0 and ended_ns != 0 and now_ns - ended_ns < STEADY * design.silence_ns[sensor])


@kernel
def note_gap(track: Any, design: Any, sensor: int, t_ns: int, live: bool) -> None:
    """Learn from the time since the sensor's last reading; a silence soon after another continues it."""
    if live and STEADY > 0:
        track.live[sensor] = 1
    limit = deadline_ns(track, design, sensor)
    gap_ns = t_ns - track.sensor_t_ns[sensor]
    if limit == 0 or gap_ns <= 0:
        return
    if STEADY > 0 and track.sensor_seen[sensor]:
        learn_gap(track, design, sensor, gap_ns, limit)
    again = unsteady(track, design, sensor, t_ns) and gap_ns > BROKEN * design.silence_ns[sensor]
    if gap_ns > limit or again:
        if not unsteady(track, design, sensor, t_ns):
            track.gap_from_ns[sensor] = track.sensor_t_ns[sensor]
        track.gap_to_ns[sensor] = t_ns


@kernel
def is_silent(track: Any, design: Any, sensor: int, now_ns: int) -> bool:
    """Whether the sensor has said nothing for too long."""
    return bool(0 < deadline_ns(track, design, sensor) < now_ns - track.sensor_t_ns[sensor])


@kernel
def was_silent(track: Any, design: Any, sensor: int, then_ns: int) -> bool:
    """Whether the last silence that ended had by then become one, or was over."""
    from_ns = track.gap_from_ns[sensor] + deadline_ns(track, design, sensor)
    return bool(then_ns > min(from_ns, track.gap_to_ns[sensor] - 1))


@kernel
def silent_since(track: Any, design: Any, sensor: int) -> int:
    """Last reading before the silence, or before the first of several in a row."""
    last_ns = track.sensor_t_ns[sensor]
    if unsteady(track, design, sensor, last_ns):
        return int(track.gap_from_ns[sensor])
    return int(last_ns)
