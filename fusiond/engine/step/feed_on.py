"""The command drives the prediction: as an input of the process model, or in the place of one that is out.

Acknowledgements on `applied` say what the actuator did, and are inputs like any other. Where none has come lately, the
command that now acts stands for it, as a reading of `applied` that nobody sent: it takes its place in the ring, is
replayed with the readings around it, and a replay of the log computes it once more. A command always comes
last of its stamp. The readings of that stamp are not moved by it, since it holds from its stamp on; thus equal bits.

Where the prediction is driven by a measured input instead, the command stands in for it while it is silent or excluded
(`control.stand_in`): a car without its accelerometer is still known to be pushed.

`assembly` copies this file over `feed.py`.
"""

from __future__ import annotations

from typing import Any

from fusiond.engine.records import CENTRAL, FED
from fusiond.numerics.kernel import kernel
from fusiond.types import Role

from .monitor import is_excluded, take_for_usual
from .predict import follow
from .silence import is_silent
from .sizes import CONTROLS, FILTERS

INPUT = int(Role.INPUT)


@kernel
def note_applied(desk: Any, design: Any, reading: Any) -> None:
    """Remember the newest acknowledgement."""
    if reading.sensor == design.feeds and (not desk.has_applied or reading.t_ns >= desk.applied_t_ns):
        desk.has_applied = 1
        desk.applied_t_ns = reading.t_ns
        for i in range(CONTROLS):
            desk.applied[i] = reading.z[i]


@kernel
def write_acting(desk: Any, design: Any, now_ns: int, reading: Any) -> bool:
    """Whether no acknowledgement has come lately; `reading` then says that the command acts."""
    acknowledges = design.role[design.feeds] == INPUT and desk.has_applied
    if acknowledges and abs(now_ns - desk.applied_t_ns) <= design.acknowledged_ns:
        return False
    in_step = (
        design.step_ns > 0
    )  # a discrete model: the command is that of its step, however late it was computed
    reading.t_ns = desk.command_due_ns - design.control_period_ns if in_step else now_ns
    reading.arrival_ns = 0
    reading.seq = 0
    reading.sensor = design.feeds
    reading.length = CONTROLS
    reading["flags"] = FED
    for i in range(CONTROLS):
        reading.z[i] = desk.acting[i]
    return True


@kernel
def stand_in(track: Any, design: Any, work: Any, reading: Any) -> None:
    """Say what the input that is out would read from now on; the filters go to now by what was said before.

    While the input works its bias is followed, so that what is said later has the bias of then.
    """
    sensor = design.stands_for
    if sensor < 0:
        return
    out = is_silent(track, design, sensor, reading.t_ns) or is_excluded(track, sensor, reading.t_ns)
    if out:
        for row in range(FILTERS):
            follow(track, design, work, row, reading.t_ns)
    elif design.stand_plus >= 0:
        take_for_usual(track, design.feeds, track.x[CENTRAL, design.stand_plus])
    value = design.stand_offset + track.monitor.usual[design.feeds, 0]
    for i in range(CONTROLS):
        value += design.stand_gain[i] * reading.z[i]
    take_for_usual(track, sensor, value)
