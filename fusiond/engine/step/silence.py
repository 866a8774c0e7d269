"""Silence: how long a sensor may say nothing, and how long it must then speak to be believed steady.

With fault detection the deadline is learnt: two and a half periods, or as much again as half of the longest gap the
stream has lately shown, and where arrivals are known never less than a host may hold readings back. A stream that
breaks off again and again stays silent until it has spoken for STEADY times its first deadline
without a break.
"""

from __future__ import annotations

from typing import Any

from fusiond.numerics.kernel import kernel

from .sizes import STEADY

MARGIN = 1.5
"""A deadline is this much longer than the longest gap of late."""
FORGET = 0.002
"""Share of the longest gap forgotten with every reading."""
BROKEN = 4
"""A stream not yet steady again is still broken by a gap of so many first deadlines, whatever has been learnt."""
HELD_BACK_NS = 50_000_000
"""A live stream's readings may come this much later than the time that has passed elsewhere says."""


@kernel
def deadline_ns(track: Any, design: Any, sensor: int) -> int:
    """Longest healthy silence of a sensor; 0 where none is judged."""
    limit = design.silence_ns[sensor]
    if STEADY == 0 or limit == 0 or not design.learns_silence[sensor]:
        return int(limit)
    limit = max(limit, int(MARGIN * track.longest_gap_ns[sensor]))
    return int(max(limit, HELD_BACK_NS) if track.live[sensor] else limit)


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
    longest = track.longest_gap_ns[sensor]
    learnt = min(gap_ns, 2 * limit) if track.sensor_seen[sensor] else 0
    track.longest_gap_ns[sensor] = max(learnt, longest - int(FORGET * longest))
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
def silent_since(track: Any, design: Any, sensor: int) -> int:
    """Last reading before the silence, or before the first of several in a row."""
    last_ns = track.sensor_t_ns[sensor]
    if unsteady(track, design, sensor, last_ns):
        return int(track.gap_from_ns[sensor])
    return int(last_ns)
