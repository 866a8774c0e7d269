"""What one reading, in its place in time, does to the track."""

from __future__ import annotations

from typing import Any

from fusiond.engine.records import CENTRAL, HAS_ARRIVAL, HAS_R
from fusiond.numerics.arrays import copy_matrix, copy_vector
from fusiond.numerics.kernel import kernel
from fusiond.types import Hold, Role, Verdict

from .adapt import begin_noise
from .feed import stand_in
from .monitor import corrected, fall_back, is_excluded, note_held, note_input, note_value
from .pending import nothing_pending
from .predict import follow
from .silence import note_gap
from .sizes import FEEDS, FILTERS, SENSORS
from .update import correct, innovate

APPLIED = int(Role.APPLIED)
INPUT = int(Role.INPUT)
PREVIOUS = int(Hold.PREVIOUS)
USED = int(Verdict.USED)
HELD = int(Verdict.HELD)
EXCLUDED = int(Verdict.EXCLUDED)


@kernel
def start(track: Any, design: Any, t_ns: int) -> None:
    """Begin at the first reading's stamp, with the configured initial state."""
    track.started = 1
    track.start_ns = t_ns
    track.t_ns = t_ns
    track.update_ns = t_ns
    track.learned[:] = 0.0
    for row in range(FILTERS):
        track.filter_t_ns[row] = t_ns
        copy_vector(design.x0, track.x[row])
        copy_matrix(design.U0, track.U[row])
        copy_vector(design.d0, track.d[row])
        nothing_pending(track, row)
    for sensor in range(SENSORS):
        track.sensor_seen[sensor] = 0
        track.sensor_t_ns[sensor] = t_ns
        track.gap_to_ns[sensor] = 0
    begin_noise(track, design)


@kernel
def hold_input(track: Any, design: Any, reading: Any, report: Any) -> None:
    """Hold the numbers of an input, and their variances, in track.u, u_var."""
    sensor = reading.sensor
    for i in range(design.length[sensor]):
        driven = design.drives[sensor, i]
        variance = reading.R[i, i] if reading["flags"] & HAS_R else design.R[sensor, i]
        track.u[driven] = reading.z[i]
        track.u_var[driven] = variance
        report.R_used[i] = variance
        report.R_declared[i] = variance


@kernel
def drive(track: Any, design: Any, work: Any, reading: Any, report: Any) -> None:
    """An input moves every filter to its stamp: with itself (hold previous) or with what was held (hold next)."""
    if design.hold[reading.sensor] == PREVIOUS:
        hold_input(track, design, reading, report)
    for row in range(FILTERS):
        follow(track, design, work, row, reading.t_ns)
    if design.hold[reading.sensor] != PREVIOUS:
        hold_input(track, design, reading, report)


@kernel
def repeats(track: Any, design: Any, reading: Any) -> bool:
    """Whether the reading only repeats the last value of a sensor that holds it between fixes."""
    sensor = reading.sensor
    if not (design.holds_value[sensor] and track.sensor_seen[sensor]):
        return False
    for i in range(design.length[sensor]):
        if track.sensor_z[sensor, i] != reading.z[i]:
            return False
    return True


@kernel
def update(track: Any, design: Any, work: Any, reading: Any, report: Any) -> None:
    """Correct every filter that hears the sensor; an excluded one is heard by its own local filter alone."""
    sensor = reading.sensor
    excluded = is_excluded(track, sensor, reading.t_ns)
    if not excluded:
        track.update_ns = reading.t_ns
    for row in range(FILTERS):
        out = excluded and not design.alone[row]
        if design.heard[sensor, row] and (row == CENTRAL or not out):
            correct(track, design, work, row, reading, out, report)


@kernel
def apply(track: Any, design: Any, work: Any, reading: Any, report: Any) -> None:
    """Apply one screened reading, no older than the last one applied. Writes report.verdict, nu, S, R_*, e, nis.

    A filter that does not hear the sensor is left wholly untouched.
    """
    sensor = reading.sensor
    if not track.started:
        start(track, design, reading.t_ns)
    track.t_ns = reading.t_ns
    note_gap(track, design, sensor, reading.t_ns, reading["flags"] & HAS_ARRIVAL != 0)
    track.sensor_t_ns[sensor] = reading.t_ns
    if repeats(track, design, reading):
        report.verdict = HELD
        innovate(track, design, work, CENTRAL, reading)
        note_held(track, design, work, reading)
        return
    report.verdict = USED
    note_value(track, design, reading)
    given = corrected(track, design, reading, work.spare)
    fall_back(track, design, given.t_ns)
    if design.role[sensor] == INPUT:
        if is_excluded(track, sensor, reading.t_ns):
            report.verdict = EXCLUDED
        else:
            note_input(track, design, work, given)
            drive(track, design, work, given, report)
    elif FEEDS > 0 and design.role[sensor] == APPLIED:
        stand_in(track, design, work, given)
    else:
        update(track, design, work, given, report)
    track.sensor_seen[sensor] = 1
    for i in range(design.length[sensor]):
        track.sensor_z[sensor, i] = reading.z[i]
