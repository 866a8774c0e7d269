"""The command is an input of the process model: what acts from now on drives the prediction.

Acknowledgements on `applied` say what the actuator did, and are inputs like any other. Where none has come lately, the
command that now acts stands for it, as a reading of `applied` that nobody sent: it takes its place in the ring, is
replayed with the readings around it, and a replay of the log computes it once more. A command always comes
last of its stamp. The readings of that stamp are not moved by it, since it holds from its stamp on; thus equal bits.

`assembly` copies this file over `feed.py`.
"""

from __future__ import annotations

from typing import Any

from fusiond.numerics.kernel import kernel

from .sizes import CONTROLS


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
    if desk.has_applied and abs(now_ns - desk.applied_t_ns) <= design.acknowledged_ns:
        return False
    reading.t_ns = now_ns
    reading.arrival_ns = 0
    reading.seq = 0
    reading.sensor = design.feeds
    reading.length = CONTROLS
    reading["flags"] = 0
    for i in range(CONTROLS):
        reading.z[i] = desk.acting[i]
    return True
