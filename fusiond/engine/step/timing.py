"""Whose clock to believe: readings too late or too far ahead are refused, a run of them means that time itself jumped.

Theory of operation. The newest accepted stamp, plus the arrival time that has passed since, is what the clock should
show. A reading further ahead than `ahead_ns` or further behind than the horizon is odd and refused. One odd sensor
among sound ones stays refused, since every sound reading ends the run. Only when `resync` odd readings in a row agree
with each other, and nothing sound has come for `quiet_ns` (by arrivals; where these are unknown, by the run's own
stamps), has the whole time base jumped (a clock step, a recording that starts again); then, with arrivals, the state is
carried to the new base with the time that really passed; without, a forward jump is a gap to be predicted over and a
backward one a fresh start.
"""

from __future__ import annotations

from typing import Any

from fusiond.engine.records import HAS_ARRIVAL
from fusiond.numerics.kernel import kernel
from fusiond.types import NANOSECONDS, Action, Verdict

from .apply import start
from .inject import between
from .monitor import forget_all
from .sizes import FILTERS, SENSORS, SNAPSHOT_EVERY

USED = int(Verdict.USED)
TOO_LATE = int(Verdict.TOO_LATE)
FROM_FUTURE = int(Verdict.FROM_FUTURE)
NONE = int(Action.NONE)
RETIMED = int(Action.RETIMED)
RESET = int(Action.RESET)
FORGET = 0.002
"""Share of a sensor's lateness forgotten with each of its readings."""
LONGEST_GAP_NS = 3600 * NANOSECONDS
"""A longer gap in a recording without arrivals is not predicted over."""


@kernel
def passed_ns(desk: Any, reading: Any) -> int:
    """Arrival time since the newest accepted reading; 0 where arrivals are unknown."""
    if reading["flags"] & HAS_ARRIVAL and desk.has_arrival:
        return max(0, reading.arrival_ns - desk.newest_arrival_ns)
    return 0


@kernel
def judge_stamp(desk: Any, design: Any, reading: Any) -> int:
    """USED, TOO_LATE or FROM_FUTURE for the stamp of one reading."""
    if not desk.started:
        return USED
    if reading.t_ns - desk.newest_t_ns - passed_ns(desk, reading) > design.ahead_ns:
        return FROM_FUTURE
    if reading.t_ns < desk.newest_t_ns - design.horizon_ns:
        return TOO_LATE
    return USED


@kernel
def time_jumped(desk: Any, design: Any, reading: Any) -> bool:
    """Count one more odd stamp; whether the run of them is now proof that time itself jumped."""
    step = reading.t_ns - desk.odd_t_ns
    agrees = desk.odd_count > 0 and -design.horizon_ns <= step <= design.ahead_ns
    if not agrees:
        desk.odd_count = 0
        desk.odd_start_ns = reading.t_ns
    desk.odd_count += 1
    desk.odd_t_ns = reading.t_ns
    known = reading["flags"] & HAS_ARRIVAL and desk.has_arrival
    silent_ns = passed_ns(desk, reading) if known else reading.t_ns - desk.odd_start_ns
    return bool(desk.odd_count >= design.resync and silent_ns > design.quiet_ns)


@kernel
def forget_readings(desk: Any, marks: Any) -> None:
    """Empty the ring; its next place is one where a snapshot is due."""
    after = desk.ring_first + desk.ring_count
    desk.ring_first = (after + SNAPSHOT_EVERY - 1) // SNAPSHOT_EVERY * SNAPSHOT_EVERY
    desk.ring_count = 0
    marks[:] = -1


@kernel
def restart(track: Any, desk: Any, design: Any, marks: Any) -> int:
    """Set the state to its initial value, where it stays until the next reading; returns the action taken.

    Counts it in track.resets and writes track.jump, which leads from the last estimate (at its own time) to the new.
    """
    forget_readings(desk, marks)
    track.resets += 1
    track.jump[:] = 0.0
    if track.started:
        between(track.x[0], design.x0, track.jump, design)
    start(track, design, track.t_ns)
    track.started = 0
    forget_all(track, desk)
    return RESET


@kernel
def follow_jump(track: Any, desk: Any, design: Any, marks: Any, reading: Any) -> int:
    """Carry the track to the new time base of `reading`; returns the action taken."""
    jump_ns = reading.t_ns - desk.newest_t_ns
    if reading["flags"] & HAS_ARRIVAL and desk.has_arrival:
        forget_readings(desk, marks)
        shift_ns = jump_ns - passed_ns(desk, reading)
        track.t_ns += shift_ns
        track.start_ns += shift_ns
        track.update_ns += shift_ns
        for row in range(FILTERS):
            track.filter_t_ns[row] += shift_ns
        for sensor in range(SENSORS):
            track.sensor_t_ns[sensor] += shift_ns
        action = RETIMED
    elif 0 < jump_ns <= LONGEST_GAP_NS:
        forget_readings(desk, marks)
        action = NONE
    else:
        action = restart(track, desk, design, marks)
    desk.command_due_ns = reading.t_ns
    desk.newest_t_ns = reading.t_ns
    return action


@kernel
def note_stamp(desk: Any, reading: Any) -> None:
    """Remember an accepted reading as the newest, if it is, and by how much its sensor's come behind the newest."""
    desk.odd_count = 0
    if not desk.started or reading.t_ns >= desk.newest_t_ns:
        desk.started = 1
        desk.newest_t_ns = reading.t_ns
        if reading["flags"] & HAS_ARRIVAL:
            desk.newest_arrival_ns = reading.arrival_ns
            desk.has_arrival = 1
    longest, behind_ns = desk.lateness_ns[reading.sensor], desk.newest_t_ns - reading.t_ns
    desk.lateness_ns[reading.sensor] = max(behind_ns, longest - int(FORGET * longest))
