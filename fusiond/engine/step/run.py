"""The compiled entry: a batch of readings in arrival order through the whole step."""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.engine.records import CENTRAL, JUDGED, TO_JUDGE, TO_REPLAY
from fusiond.numerics.kernel import entry, kernel
from fusiond.types import RESET, TICK, Action, Role, Verdict

from .apply import apply
from .feed import note_applied, write_acting
from .finish import finish
from .monitor import awaits_judgement, fall_back, note_unusable
from .pending import compose
from .predict import predict
from .protect import protect
from .screen import comes_after, note_sequence, same_values, screen, sequence_repeats
from .sizes import FEEDS, PAYLOAD, SENSORS, SNAPSHOT_EVERY
from .timing import follow_jump, judge_stamp, note_stamp, restart, time_jumped

USED = int(Verdict.USED)
DUPLICATE = int(Verdict.DUPLICATE)
CONFLICT = int(Verdict.CONFLICT)
REFERENCE = int(Role.REFERENCE)
APPLIED = int(Role.APPLIED)
NONE = int(Action.NONE)
REPLAYED = int(Action.REPLAYED)


@kernel
def begin_report(reading: Any, report: Any) -> None:
    """Copy what the reading says, with no gate; the rest of the report is zeroed by the caller."""
    report.limit = np.inf
    report.t_ns = reading.t_ns
    report.arrival_ns = reading.arrival_ns
    report.seq = reading.seq
    report.sensor = reading.sensor
    report.length = reading.length
    for i in range(PAYLOAD):
        report.z[i] = reading.z[i]


@kernel
def measured(readings: Any, k: int, design: Any, spare: Any) -> Any:
    """Reading k at the time of its measurement: itself, or a copy whose stamp has the sensor's delay taken off."""
    sensor = readings[k].sensor
    spare[0] = readings[k]
    if 0 <= sensor < SENSORS:
        spare[0].t_ns -= design.delay_ns[sensor]
    return spare[0]


@kernel
def is_news(t_ns: int, last_ns: int, horizon_ns: int) -> bool:
    """Whether a message replaces the last one: an older one does not, unless that one's clock must have been wrong."""
    return t_ns >= last_ns or t_ns < last_ns - horizon_ns


@kernel
def accept(desk: Any, design: Any, reading: Any) -> None:
    """Hand a reference or an acknowledgement to the controller; one that comes late changes nothing."""
    if design.role[reading.sensor] == REFERENCE:
        if not desk.has_reference or is_news(reading.t_ns, desk.reference_t_ns, design.horizon_ns):
            desk.has_reference = 1
            desk.reference_t_ns = reading.t_ns
            for i in range(reading.length):
                desk.reference[i] = reading.z[i]
    elif is_news(reading.t_ns, desk.applied_t_ns, design.horizon_ns):
        desk.has_applied = 1
        desk.applied_t_ns = reading.t_ns
        for i in range(reading.length):
            desk.applied[i] = reading.z[i]


@kernel
def ring_is_full(desk: Any, design: Any, ring: Any) -> bool:
    """Whether one more reading, and the command after it, would push out one that a late reading may need."""
    size = ring.shape[0]
    if desk.ring_count + FEEDS < size:
        return False
    oldest_needed = ring[(desk.ring_first + SNAPSHOT_EVERY + FEEDS) % size]
    return bool(oldest_needed.t_ns >= desk.newest_t_ns - design.horizon_ns)


@kernel
def place_of(desk: Any, ring: Any, reading: Any) -> int:
    """Absolute place of the reading in the ring, or -1 where an equal one is there already."""
    size = ring.shape[0]
    place = desk.ring_first + desk.ring_count
    while place > desk.ring_first:
        before = ring[(place - 1) % size]
        if not comes_after(before, reading):
            break
        place -= 1
    scan = place - 1
    while scan >= desk.ring_first and ring[scan % size].t_ns == reading.t_ns:
        other = ring[scan % size]
        if other.sensor == reading.sensor and other.seq == reading.seq and same_values(other, reading):
            return -1
        scan -= 1
    return int(place)


@kernel
def contradicts(desk: Any, ring: Any, reading: Any) -> bool:
    """Whether the reading of its sensor with the same sequence number, if it is still known, said something else."""
    size = ring.shape[0]
    for k in range(desk.ring_first + desk.ring_count - 1, desk.ring_first - 1, -1):
        other = ring[k % size]
        if other.sensor == reading.sensor and other.seq == reading.seq:
            return other.t_ns != reading.t_ns or not same_values(other, reading)
    return False


@kernel
def insert(desk: Any, ring: Any, reading: Any, place: int) -> None:
    """Put the reading at its place; later ones move up, and a full ring forgets its oldest."""
    size = ring.shape[0]
    if desk.ring_count == size:
        desk.ring_first += 1
        desk.ring_count -= 1
    last = desk.ring_first + desk.ring_count
    for k in range(last, place, -1):
        ring[k % size] = ring[(k - 1) % size]
    ring[place % size] = reading
    desk.ring_count += 1


@kernel
def advance_from(
    tracks: Any, desk: Any, design: Any, work: Any, spares: Any, ring: Any, snapshots: Any, marks: Any,
    place: int, first: int, reports: Any, at: int,
) -> None:  # fmt: skip
    """Apply the ring from `first` to its end, and report on what stands at `place` into reports[at].

    Where `first` is not the end already, the track is that of the snapshot there.
    """
    size, kept = ring.shape[0], snapshots.shape[0]
    end = desk.ring_first + desk.ring_count
    untouched = end - 1 if place < end else end
    if first < untouched:
        tracks[0] = snapshots[first // SNAPSHOT_EVERY % kept]
    for k in range(first, end):
        if k % SNAPSHOT_EVERY == 0:
            snapshots[k // SNAPSHOT_EVERY % kept] = tracks[0]
            marks[k // SNAPSHOT_EVERY % kept] = k
        report = reports[at] if k == place else spares[0]
        apply(tracks[0], design, work, ring[k % size], report)


@kernel
def take(
    tracks: Any, desk: Any, design: Any, work: Any, ring: Any, marks: Any, reading: Any, report: Any
) -> int:
    """Take one reading of a sensor: screen it and give it its place in the ring; -1 where it gets none."""
    track = tracks[0]
    report.verdict = screen(track, design, work, reading)
    note_unusable(track, desk, reading, report.verdict == USED)
    if report.verdict != USED:
        return -1
    if sequence_repeats(desk, reading):
        report.verdict = DUPLICATE
        if contradicts(desk, ring, reading):
            report.verdict = CONFLICT
            note_unusable(track, desk, reading, False)
        return -1
    role = design.role[reading.sensor]
    if role == REFERENCE or role == APPLIED:
        accept(desk, design, reading)
        note_sequence(desk, reading)
        return -1
    report.verdict = judge_stamp(desk, design, reading)
    if report.verdict != USED:
        if not time_jumped(desk, design, reading):
            return -1
        report.action = follow_jump(track, desk, design, marks, reading)
    place = place_of(desk, ring, reading)
    if place < 0:
        report.verdict = DUPLICATE
        return -1
    note_stamp(desk, reading)
    note_sequence(desk, reading)
    insert(desk, ring, reading, place)
    note_applied(desk, design, reading)
    return place


@kernel
def beginning(desk: Any, place: int, report: Any) -> int:
    """Where to begin so that the reading at `place` is applied in its order; the ring's end for one without a place."""
    end = desk.ring_first + desk.ring_count
    if place < 0:
        return int(end)
    if place < end - 1:
        report.action = REPLAYED
        return place // SNAPSHOT_EVERY * SNAPSHOT_EVERY
    return place


@kernel
def feed(
    tracks: Any, desk: Any, design: Any, work: Any, spares: Any, ring: Any, snapshots: Any, marks: Any,
    now_ns: int,
) -> None:  # fmt: skip
    """Drive the prediction with the command that acts from now on, where the configuration wants that."""
    _, reports, readings = spares
    if write_acting(desk, design, now_ns, readings[0]):
        place = desk.ring_first + desk.ring_count
        if ring[(place - 1) % ring.shape[0]].t_ns > readings[0].t_ns:
            place = place_of(desk, ring, readings[0])
        if place >= 0:
            insert(desk, ring, readings[0], place)
            first = beginning(desk, place, reports[0])
            advance_from(
                tracks, desk, design, work, reports, ring, snapshots, marks, place, first, reports, 0
            )


@entry
def run(
    tracks: Any, desks: Any, design: Any, works: Any, spares: Any, ring: Any, snapshots: Any, marks: Any,
    readings: Any, reports: Any, covariances: Any,
) -> int:  # fmt: skip
    """Take readings in the order given and write a report on each.

    Args:
        tracks, desks, design, works: one record each.   spares: (1,) track, report and reading records, scratch.
        ring, snapshots, marks: history; a snapshot marked k is the track before absolute reading k was applied.
        readings, reports: as many of one as of the other, reports zeroed.
        covariances: (count, n, n), the centralized covariance after each reading; (0, n, n) where nobody asks.
    Returns:
        How many were taken; none with desk.pause == TO_REPLAY, which needs a reading for form's sake only. Fewer than
        given means that the ring must grow before the next or, with desk.pause == TO_JUDGE, that the next has been
        applied and raised an alarm: judge, set JUDGED, and give it again.
    """
    desk, work = desks[0], works[0]
    spare_tracks, spare_reports, spare_readings = spares
    for k in range(readings.shape[0]):
        if desk.pause != TO_REPLAY and ring_is_full(desk, design[0], ring):
            return k
        reading, report = measured(readings, k, design[0], spare_readings), reports[k]
        phase, desk.pause = desk.pause, 0
        ends = tracks
        place = first = desk.ring_first + desk.ring_count
        if phase == TO_REPLAY:
            first = desk.replay_from
        elif phase != JUDGED:
            begin_report(readings[k], report)
            if reading.sensor == TICK:
                ends = spare_tracks
                spare_tracks[0] = tracks[0]
                fall_back(spare_tracks[0], design[0], reading.t_ns)
                if tracks[0].started:
                    predict(spare_tracks[0], design[0], work, CENTRAL, reading.t_ns)
            elif reading.sensor == RESET:
                report.action = restart(tracks[0], desk, design[0], marks)
                place = first = desk.ring_first + desk.ring_count
            else:
                place = take(tracks, desk, design[0], work, ring, marks, reading, report)
                first = beginning(desk, place, report)
        advance_from(
            tracks, desk, design[0], work, spare_reports, ring, snapshots, marks, place, first, reports, k
        )
        if phase == TO_REPLAY:
            return k
        if phase != JUDGED and awaits_judgement(tracks[0], desk):
            desk.pause = TO_JUDGE
            return k
        now_ns = reading.t_ns if reading.sensor == TICK else tracks[0].t_ns
        protect(ends[0], design[0], work, report)
        finish(ends[0], desk, design[0], now_ns, report)
        if covariances.shape[0] > 0:
            compose(tracks[0], covariances[k])
        if FEEDS > 0 and report.command_due:
            feed(tracks, desk, design[0], work, spares, ring, snapshots, marks, now_ns)
    return readings.shape[0]
