"""What one reading, in its place in time, does to the track of a plain step."""

from __future__ import annotations

from typing import Any

from fusiond.engine.step.adapt import begin_noise
from fusiond.engine.step.apply import drive, repeats
from fusiond.engine.step.decided import corrected, is_excluded
from fusiond.engine.step.sizes import FILTERS
from fusiond.numerics.ud import ud_compose
from fusiond.types import Role, Verdict

from .correct import correct

INPUT = int(Role.INPUT)
USED = int(Verdict.USED)
HELD = int(Verdict.HELD)
EXCLUDED = int(Verdict.EXCLUDED)


def start(track: Any, design: Any, t_ns: int) -> None:
    """Begin at the first reading's stamp, with the configured initial state; a local filter with its share of it."""
    track.started = 1
    track.start_ns = track.t_ns = track.update_ns = t_ns
    track.filter_t_ns[:] = t_ns
    ud_compose(design.U0, design.d0, track.honest)
    for row in range(FILTERS):
        track.x[row] = design.x0
        track.P[row] = track.honest / design.share[row]
    track.batch_size = 0
    track.sensor_seen[:] = 0
    track.sensor_t_ns[:] = t_ns
    begin_noise(track, design)


def apply(track: Any, design: Any, work: Any, reading: Any, report: Any) -> None:
    """Apply one screened reading, no older than the last one applied. Writes report.verdict, nu, S, R_*, e, nis."""
    sensor = reading.sensor
    if not track.started:
        start(track, design, reading.t_ns)
    track.t_ns = reading.t_ns
    track.sensor_t_ns[sensor] = reading.t_ns
    if repeats(track, design, reading):
        report.verdict = HELD
        return
    report.verdict = USED
    if is_excluded(track, sensor, reading.t_ns):
        report.verdict = EXCLUDED
    else:
        use(track, design, work, corrected(track, design, reading, work.spare), report)
    track.sensor_seen[sensor] = 1
    length = design.length[sensor]
    track.sensor_z[sensor, :length] = reading.z[:length]


def use(track: Any, design: Any, work: Any, given: Any, report: Any) -> None:
    """Drive or correct with a reading whose sensor's known error has been taken off."""
    if design.role[given.sensor] == INPUT:
        drive(track, design, work, given, report)
        return
    correct(track, design, work, given, report)
    report.R_declared /= 1.0 + track.reaction.noise_excess[given.sensor]
    track.update_ns = given.t_ns
