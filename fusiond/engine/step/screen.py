"""The door: every reading that cannot be used is refused by name, before it touches anything."""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.engine.records import CENTRAL, FED, HAS_R, HAS_SEQ
from fusiond.numerics.kernel import kernel
from fusiond.types import Role, Verdict

from .sizes import PAYLOAD, SENSORS
from .update import innovate, load_noise

USED = int(Verdict.USED)
NON_FINITE = int(Verdict.NON_FINITE)
WRONG_LENGTH = int(Verdict.WRONG_LENGTH)
OUT_OF_RANGE = int(Verdict.OUT_OF_RANGE)
BAD_COVARIANCE = int(Verdict.BAD_COVARIANCE)
UNKNOWN_INDEX = int(Verdict.UNKNOWN_INDEX)
UNKNOWN_SENSOR = int(Verdict.UNKNOWN_SENSOR)
UPDATE = int(Role.UPDATE)


@kernel
def covariance_is_sound(reading: Any, design: Any, work: Any) -> bool:
    """Whether the R that came with the reading, if any, can be used."""
    if not reading["flags"] & HAS_R:
        return True
    sensor = reading.sensor
    for i in range(design.dof[sensor]):
        if not (0.0 <= reading.R[i, i] < np.inf):
            return False
    return design.role[sensor] != UPDATE or load_noise(reading, design, work)


@kernel
def screen(track: Any, design: Any, work: Any, reading: Any) -> int:
    """Verdict on the reading by itself: USED where nothing speaks against it."""
    sensor = reading.sensor
    if not 0 <= sensor < SENSORS:
        return UNKNOWN_SENSOR
    length = design.length[sensor]
    if reading.length != length:
        return WRONG_LENGTH
    for i in range(length):
        if not np.isfinite(reading.z[i]):
            return NON_FINITE
    for i in range(length):
        if not design.lower[sensor, i] <= reading.z[i] <= design.upper[sensor, i]:
            return OUT_OF_RANGE
    if not covariance_is_sound(reading, design, work):
        return BAD_COVARIANCE
    carries_index = design.role[sensor] == UPDATE and design.dof[sensor] < length
    if carries_index and not innovate(track, design, work, CENTRAL, reading):
        return UNKNOWN_INDEX
    return USED


@kernel
def same_values(a: Any, b: Any) -> bool:
    """Whether two readings carry the same numbers."""
    for i in range(PAYLOAD):
        if a.z[i] != b.z[i]:
            return False
    return a.length == b.length


@kernel
def comes_after(a: Any, b: Any) -> bool:
    """Whether reading a is processed after b: by stamp, sensor (inputs first), sequence number, then values.

    A command stands before what the actuator says of it.
    """
    if a.t_ns != b.t_ns:
        return bool(a.t_ns > b.t_ns)
    if a.sensor != b.sensor:
        return bool(a.sensor > b.sensor)
    if a["flags"] & FED != b["flags"] & FED:
        return bool(b["flags"] & FED != 0)
    if a.seq != b.seq:
        return bool(a.seq > b.seq)
    for i in range(PAYLOAD):
        if a.z[i] != b.z[i]:
            return bool(a.z[i] > b.z[i])
    return False


@kernel
def sequence_repeats(desk: Any, reading: Any) -> bool:
    """Whether this sequence number came before, among the 64 up to the highest of its sensor."""
    sensor = reading.sensor
    if not (reading["flags"] & HAS_SEQ and desk.seq_any[sensor]):
        return False
    if reading.seq > desk.seq_top[sensor]:
        return False
    behind = desk.seq_top[sensor] - reading.seq
    restarted = reading.seq == 0 and reading.t_ns > desk.newest_t_ns
    return behind < 64 and not restarted and (desk.seq_seen[sensor] >> behind) & np.uint64(1) != 0


@kernel
def note_sequence(desk: Any, reading: Any) -> None:
    """Remember the sequence number of an accepted reading; a number far back means the sensor started anew."""
    if not reading["flags"] & HAS_SEQ:
        return
    sensor = reading.sensor
    one = np.uint64(1)
    top = desk.seq_top[sensor]
    ahead = reading.seq - top
    behind = top - reading.seq
    restarted = reading.seq == 0 or behind >= 64
    if not desk.seq_any[sensor] or (reading.seq > top and ahead >= 64) or (reading.seq < top and restarted):
        desk.seq_any[sensor] = 1
        desk.seq_top[sensor] = reading.seq
        desk.seq_seen[sensor] = one
    elif reading.seq > top:
        desk.seq_top[sensor] = reading.seq
        desk.seq_seen[sensor] = (desk.seq_seen[sensor] << ahead) | one
    else:
        desk.seq_seen[sensor] |= one << behind
