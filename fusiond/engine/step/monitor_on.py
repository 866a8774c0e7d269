"""The hooks of the step where the configuration asks for fault detection. `assembly` copies this over `monitor.py`."""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.faults.window import LOOKED, ODD
from fusiond.numerics.kernel import kernel
from fusiond.types import Alarm, Kind, Role

from .decided import corrected, is_excluded, undelay
from .inject import between
from .signatures import bank, carry, forget_interval, move_signatures
from .silence import is_silent
from .sizes import ERRORS, INPUTS, SENSORS, STATES, WINDOW
from .spread_tests import (
    FROZEN,
    ask,
    clear_tests,
    moved,
    note_value,
    test_frozen,
    test_scatter,
    variance_gain,
)

__all__ = [
    "after_look", "after_update", "awaits_judgement", "before_update", "carry", "corrected", "fall_back", "forget_all",
    "is_excluded", "note_gate", "note_held", "note_input", "note_unusable", "note_value", "undelay",
]  # fmt: skip

INPUT = int(Role.INPUT)
GARBAGE, HEALED = int(Alarm.GARBAGE), int(Alarm.HEALED)
STUCK, UNUSABLE = int(Kind.STUCK), int(Kind.GARBAGE)
REVIEW, RETRY = int(Alarm.REVIEW), int(Alarm.RETRY)
FEW, DECAY = 1.5, 0.9
"""Unusable readings are counted with this decay per sound one; beyond FEW (two in a row) they are a fault."""
PATIENT = 6.9
"""Log likelihood ratio at which an excluded sensor is believed healed: one in a thousand that it is not."""
DIM, LIVELY = 0.3, 20
"""Where an error as large as the noise would move no innovation by DIM deviations, LIVELY sound readings are all one
can ask. Where the motion shows no error of the kind that is sought, one waits for motion."""
SHORTEST_S = 1e-4
"""A missing input's noise is spread over no shorter an interval."""
SHORTEST_HOLD, HELD_LONGER = 2, 3
"""A value may be held three times as long as it ever was, and for six readings at least."""
LOCKED = 64
"""Readings of a sensor that the gate refuses in a row: as many as a judgement has of the slowest sensor."""
RETURNED_NS = 30 * 1_000_000_000
"""Shortest time for which a sensor is refused that comes back from a silence with another story: nothing vouches for
it, and a wrong cluster of fixes after an outage ends sooner."""
FARTHEST = 1e7
"""Deviations up to which an innovation is kept as evidence; sums with the squares of larger ones lose all others."""
STRANGEST = 1e3
"""Deviations by which one value of an input at most pulls at what is usual of it."""
CAUTIOUS = 0.49
"""Least slow variance: who declares more noise than the profile covers (30 %) means it, as errors that readings share
cannot be declared otherwise. Isolation weighs with the declared noise: an alarm below it would come to nothing."""
LARGEST_SLOW = 3.0
"""An innovation this many deviations large, or larger, counts as this in the slow variance."""


@kernel
def before_update(track: Any, design: Any, work: Any, reading: Any) -> None:
    """Rate of change predicted for the reading: of the state since the last entry, and through H of the reading."""
    monitor, sensor = track.monitor, reading.sensor
    dt_ns = track.filter_t_ns[0] - monitor.t_after_ns
    if monitor.entries > 0 and dt_ns > 0:
        between(monitor.x_after, track.x[0], work.dx, design)
        for j in range(ERRORS):
            monitor.rate[j] = work.dx[j] / (dt_ns * 1e-9)
    for i in range(design.dof[sensor]):
        work.hdot[i] = 0.0
        for j in range(ERRORS):
            work.hdot[i] += work.H[i, j] * monitor.rate[j]
    dof = design.dof[sensor]
    for i in range(dof):
        for j in range(dof):
            work.D[i, j] = 1.0 if i == j else 0.0
    for j in range(dof - 1, 0, -1):
        for i in range(j):
            for k in range(dof):
                work.D[i, k] -= work.R_U[i, j] * work.D[j, k]


@kernel
def write_entry(track: Any, work: Any, reading: Any, dof: int, used: int) -> None:
    """Write the reading's line into the window."""
    monitor = track.monitor
    line = work.window[monitor.entries % WINDOW]
    line.t_ns, line.sensor, line.dof, line.used = reading.t_ns, reading.sensor, dof, used
    for i in range(dof):
        line.e[i], line.root[i] = min(max(work.e[i], -FARTHEST), FARTHEST), work.root[i]
        line.h[i], line.hdot[i], line.own[i] = work.h[i], work.hdot[i], work.own[i]
        for j in range(ERRORS):
            line.H[i, j] = work.H[i, j]
            line.K[i, j] = work.K[i, j]
        for j in range(dof):
            line.D[i, j] = work.D[i, j]
    for i in range(ERRORS):
        for j in range(ERRORS):
            line["T"][i, j] = monitor.carried[i, j]
        for j in range(INPUTS):
            line.B[i, j] = monitor.carried[i, ERRORS + j]
    for j in range(INPUTS):
        line.odd[j], line.odd_count[j] = monitor.odd[j], monitor.odd_count[j]
        line.away[j] = monitor.away[j] / max(monitor.away_count[j], 1)
        monitor.odd[j], monitor.odd_count[j] = 0.0, 0
        monitor.away[j], monitor.away_count[j] = 0.0, 0
    monitor.entries += 1


@kernel
def scale_innovations(track: Any, design: Any, work: Any, sensor: int, dof: int) -> None:
    """Write work.tested: the innovations, relative to the slow variance where the declared noise is not believed."""
    share = design.tests.studentise[sensor]
    variance = 1.0 + track.monitor.slow[sensor]
    scale = 1.0 / np.sqrt(variance) if share > 0.0 else 1.0
    mean_square = 0.0
    for i in range(dof):
        work.tested[i] = work.e[i] * scale
        mean_square += min(work.tested[i] * work.tested[i], LARGEST_SLOW * LARGEST_SLOW) / dof
    if share > 0.0:
        slow = variance + share * variance * (mean_square - 1.0)
        track.monitor.slow[sensor] = max(slow, CAUTIOUS) - 1.0


@kernel
def after_update(track: Any, design: Any, work: Any, reading: Any, used: bool) -> None:
    """Write the entry, run every test, and start the next interval."""
    monitor, sensor = track.monitor, reading.sensor
    dof = design.dof[sensor]
    if not used:
        work.K[:] = 0.0
    if monitor.entries == 0:
        forget_interval(track)
    end_hold(monitor, sensor)
    scale_innovations(track, design, work, sensor, dof)
    write_entry(track, work, reading, dof, 1 if used else 0)
    bank(track, design, work, sensor, dof)
    test_scatter(track, design, work, sensor, dof)
    test_frozen(track, design, work, sensor)
    begin_interval(track)


@kernel
def begin_interval(track: Any) -> None:
    """What comes next is told from the primary filter as it is now."""
    monitor = track.monitor
    forget_interval(track)
    for i in range(STATES):
        monitor.x_after[i] = track.x[0, i]
    monitor.t_after_ns = track.filter_t_ns[0]


@kernel
def after_look(track: Any, design: Any, work: Any, reading: Any) -> None:
    """Weigh an excluded sensor's reading: sound, against its old bias of either sign and against four-fold noise.

    Without its only sensor an estimate soon is too unsure to contradict anything, and its error is one draw for all
    readings. Then it is enough that the sensor lives, or it would be locked out for ever. What was frozen or no number
    has shown no error of its own: of such a sensor that is so as soon as no number of readings could tell the error
    sought from the estimate's.
    """
    monitor, reaction, sensor = track.monitor, track.reaction, reading.sensor
    dof = design.dof[sensor]
    end_hold(monitor, sensor)
    if monitor.entries == 0:
        forget_interval(track)
    write_entry(track, work, reading, dof, LOOKED)
    move_signatures(track, design, work)
    begin_interval(track)
    square = strongest = loudest = knowable = 0.0
    unusable = reaction.kind[sensor] == STUCK or reaction.kind[sensor] == UNUSABLE
    for i in range(dof):
        e = work.e[i]
        square += e * e
        error = work.h[i] * reaction.shadow_gain[sensor, i] - work.hdot[i] * reaction.shadow_lag[sensor, i]
        error += reaction.shadow_size[sensor, i]
        b = error / work.root[i] if work.root[i] > 0.0 else 0.0
        b = max(-LARGEST_SLOW, min(b, LARGEST_SLOW))
        strongest = max(strongest, abs(b))
        loudest = max(loudest, error * error / design.R[sensor, i] if design.R[sensor, i] > 0.0 else 1.0)
        unsure = work.root[i] * work.root[i] - design.R[sensor, i]
        knowable = max(knowable, 0.5 * error * error / unsure if unsure > 0.0 else PATIENT)
        for k in range(2):
            sign = 1.0 if k == 0 else -1.0
            monitor.shadow[sensor, k] = max(0.0, monitor.shadow[sensor, k] - sign * b * e + 0.5 * b * b)
    dim = strongest < DIM or (unusable and knowable < PATIENT)
    if dim and loudest >= 1.0 and square < LARGEST_SLOW * LARGEST_SLOW * dof:
        for k in range(3):
            monitor.shadow[sensor, k] += PATIENT / LIVELY
    else:
        gain = variance_gain(4.0, square, dof)
        monitor.shadow[sensor, 2] = max(0.0, monitor.shadow[sensor, 2] - gain)
    test_frozen(track, design, work, sensor)
    if monitor.run[sensor] > 0:
        monitor.shadow[sensor, 2] = 0.0
    sound = min(monitor.shadow[sensor, 0], monitor.shadow[sensor, 1], monitor.shadow[sensor, 2])
    if monitor.alarm == 0 and sound >= PATIENT:
        ask(monitor, HEALED, sensor)
        monitor.shadow[sensor] = 0.0


@kernel
def fall_back(track: Any, design: Any, t_ns: int) -> None:
    """Give inputs that are silent or excluded their usual value, and white noise of `without_var` over a second."""
    interval_s = max((t_ns - track.filter_t_ns[0]) * 1e-9, SHORTEST_S)
    for sensor in range(SENSORS):
        if design.role[sensor] != INPUT or design.without_var[sensor, 0] <= 0.0:
            continue
        silent = is_silent(track, design, sensor, t_ns)
        if silent or is_excluded(track, sensor, t_ns):
            for i in range(design.length[sensor]):
                track.u[design.drives[sensor, i]] = track.monitor.usual[sensor, i]
                track.u_var[design.drives[sensor, i]] = design.without_var[sensor, i] / interval_s


@kernel
def note_gate(track: Any, design: Any, row: int, sensor: int, nis: float) -> None:
    """Count the readings in a row that the gate of filter `row` refuses; after LOCKED it was too sure of itself.

    A gate is for what lasts shorter than a judgement. Whoever is refused for longer and still not found at fault is
    right more often than the filter that refuses it, and a gate that stays shut could never learn so. The covariance is
    scaled to what its innovation shows until one passes (fading, as of a strong tracking filter, Zhou & Frank 1996).
    """
    monitor = track.monitor
    if not nis > design.tests.gate[sensor] > 0.0:
        monitor.refused[row, sensor] = 0
        return
    if monitor.refused[row, sensor] == 0:
        returned = track.gap_to_ns[sensor] == track.t_ns
        monitor.shut_until_ns[row, sensor] = track.t_ns + (RETURNED_NS if returned else 0)
    monitor.refused[row, sensor] += 1
    locked = monitor.refused[row, sensor] >= LOCKED and track.t_ns >= monitor.shut_until_ns[row, sensor]
    if locked and np.isfinite(nis):
        for j in range(ERRORS):
            track.d[row, j] *= nis / design.dof[sensor]


@kernel
def take_for_usual(track: Any, sensor: int, value: float) -> None:
    """What an input of one number is taken to be while it is out."""
    track.monitor.usual[sensor, 0] = value


@kernel
def note_oddity(track: Any, design: Any, sensor: int, channel: int, away: float, square: float) -> None:
    """Keep how far an input was from what it usually is since the last entry."""
    monitor, number = track.monitor, design.drives[sensor, channel]
    if number >= 0:
        monitor.odd[number] = max(monitor.odd[number], square)
        monitor.away[number] += away
        monitor.away_count[number] += 1
        if square > ODD * ODD:
            monitor.odd_count[number] += 1


@kernel
def note_input(track: Any, design: Any, work: Any, reading: Any) -> None:
    """Learn what the input usually is and how far it usually is from that, and whether it repeats itself."""
    monitor, sensor = track.monitor, reading.sensor
    share = design.tests.usual_share[sensor]
    for i in range(design.length[sensor]):
        if not track.sensor_seen[sensor]:
            monitor.usual[sensor, i] = reading.z[i]
            monitor.usual_var[sensor, i] = design.R[sensor, i]
        away, variance = reading.z[i] - monitor.usual[sensor, i], monitor.usual_var[sensor, i]
        square = away * away / variance if variance > 0.0 else 0.0
        if square > STRANGEST * STRANGEST:
            away *= STRANGEST / np.sqrt(square)
        note_oddity(track, design, sensor, i, away, square)
        monitor.usual[sensor, i] += share * away
        # what is odd tells little of what is usual, but for ever it cannot stay odd
        monitor.usual_var[sensor, i] += share * variance * (min(square, ODD * ODD) - 1.0)
    test_frozen(track, design, work, sensor)


@kernel
def end_hold(monitor: Any, sensor: int) -> None:
    """Learn from a hold that has ended; one that was a fault teaches no more than it took to be one."""
    longest = max(monitor.held_longest[sensor], SHORTEST_HOLD)
    monitor.held_longest[sensor] = max(monitor.held_longest[sensor], min(monitor.held[sensor], longest + 1))
    monitor.held[sensor] = 0


@kernel
def note_held(track: Any, design: Any, work: Any, reading: Any) -> None:
    """Ask for judgement where a value is held for longer than it ever is while what it should be has moved on."""
    monitor, sensor = track.monitor, reading.sensor
    monitor.held[sensor] += 1
    longest = max(monitor.held_longest[sensor], SHORTEST_HOLD)
    too_long = monitor.held[sensor] > HELD_LONGER * longest and not is_excluded(track, sensor, reading.t_ns)
    if too_long and moved(track, design, work, sensor):
        ask(monitor, FROZEN, sensor)


@kernel
def note_unusable(track: Any, desk: Any, reading: Any, usable: bool) -> None:
    """Count readings refused at the door, and ask for judgement when they keep coming.

    They are in no ring: a late reading, which has others replayed, must not have them forgotten.
    """
    sensor = reading.sensor
    if not 0 <= sensor < SENSORS:
        return
    if usable:
        desk.garbage[sensor] *= DECAY
        return
    desk.garbage[sensor] += 1.0
    if desk.garbage[sensor] > FEW and not is_excluded(track, sensor, reading.t_ns):
        ask(track.monitor, GARBAGE, sensor)


@kernel
def forget_all(track: Any, desk: Any) -> None:
    """Neither evidence nor verdicts outlive a reset."""
    clear_tests(track)
    forget_interval(track)
    monitor, reaction = track.monitor, track.reaction
    monitor.shadow[:] = 0.0
    monitor.refused[:] = 0
    monitor.rate[:] = 0.0
    monitor.entries = 0
    reaction.excluded[:] = 0
    reaction.until_ns[:] = 0
    reaction.relapses[:] = 0
    reaction.from_ns[:] = 0
    reaction.to_ns[:] = 0
    reaction.noise_excess[:] = 0.0
    reaction.revisions[:] = 0
    reaction.barred_ns[:] = 0
    reaction.barred[:] = 0
    reaction.health[:] = 0
    reaction.kind[:] = 0
    reaction.suspects[:] = 0
    reaction.model = 0
    desk.review_at = 0
    desk.case_at = 0
    desk.retry_ns = 0
    desk.refine_ns = 0
    desk.calm_until = 0
    desk.nothing_at = 0
    desk.calm_for = 0


@kernel
def awaits_judgement(track: Any, desk: Any) -> bool:
    """Whether a test has raised its alarm, or enough readings have come for a case left open."""
    monitor = track.monitor
    if 0 < desk.review_at <= monitor.entries:
        ask(monitor, REVIEW, 0)
    if 0 < desk.retry_ns <= track.t_ns or 0 < desk.refine_ns <= track.t_ns:
        ask(monitor, RETRY, 0)
    return bool(monitor.alarm != 0)
