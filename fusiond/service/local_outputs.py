"""`local/SENSOR`: what one sensor alone would make of it, and the parity between that and the estimate.

Published after readings of that sensor were used, where somebody listens, at most `publish_hz` in data time:
`{t, t_ns, seq, epoch, state{}, std{}, parity{}, parity_std{}, bounded[]}`. parity is local minus estimate, state by
state; parity_std its standard deviation, sqrt(P_local - P) where that is positive. The states named in `bounded` are
those where it is not: theirs is sqrt(P_local) + sqrt(P), which holds whatever the two have in common. parity is empty
while the estimate is already at a later time than the local filter. `status` shows the last parity of every sensor
that bears a filter, renewed at most twice a second.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import zenoh
from numpy.typing import NDArray

from fusiond.engine.engine import Engine
from fusiond.engine.parity import Local, local_estimate, shared_slots
from fusiond.service.lease import Lease
from fusiond.service.limiter import RateLimiter
from fusiond.service.messages import Message, dumps, head
from fusiond.service.outlet import JSON, declare
from fusiond.types import Verdict

USED = int(Verdict.USED)
STATUS_HZ = 2.0


class LocalOutputs:
    """The local filters of one daemon; without any, it does nothing.

    Args:
        session: gives the results out.      prefix: the namespace.      lease: says whether anything goes out.
        publish_hz: highest rate of each `local/SENSOR`, in data time.
    """

    def __init__(
        self, session: zenoh.Session, engine: Engine, prefix: str, *, lease: Lease, publish_hz: float
    ) -> None:
        layout = engine.layout
        self._engine, self._lease = engine, lease
        self._states = [slot.name for slot in layout.states]
        self._errors = [slot.name for slot in layout.errors]
        self._shared = [self._errors[k] for _, k in shared_slots(engine)]
        rows = {one.sensor: row for row, one in enumerate(layout.filters) if one.hears == "only"}
        self._rows = {layout.numbers[name]: row for name, row in rows.items()}
        self._names = {layout.numbers[name]: name for name in rows}
        self._publishers = {
            number: declare(session, f"{prefix}/local/{name}", JSON, zenoh.Priority.DATA_LOW, lease)
            for number, name in self._names.items()
        }
        self._limits = {number: RateLimiter(publish_hz) for number in self._rows}
        self._status_limits = {number: RateLimiter(STATUS_HZ) for number in self._rows}
        self._seq = dict.fromkeys(self._rows, 0)
        self._asked: set[int] = set()
        self._latest: dict[int, Message] = {}

    def publish(self, reports: NDArray[Any]) -> None:
        """Send the local filters whose sensor was used in these reports: as they are now, at the batch's end."""
        if not self._rows:
            return
        used = reports["sensor"][reports["verdict"] == USED]
        for number in self._rows.keys() & set(used.tolist()):
            t_ns = int(self._engine.track["filter_t_ns"][0, self._rows[number]])
            goes_out = number in self._asked and self._limits[number].passes(t_ns)
            if goes_out or self._status_limits[number].passes(t_ns):
                self._tell(number, goes_out=goes_out)

    def look_who_asks(self) -> None:
        """Find out whose local filter somebody listens to; called now and then, since asking Zenoh takes time."""
        self._asked = {number for number, publisher in self._publishers.items() if publisher.is_heard}

    def status(self) -> dict[str, Message]:
        """The last parity of every sensor that bears a filter, by name."""
        return {
            self._names[number]: {name: message[name] for name in ("t", "parity", "parity_std", "bounded")}
            for number, message in self._latest.items()
        }

    def _tell(self, number: int, *, goes_out: bool) -> None:
        local = local_estimate(self._engine, self._rows[number])
        self._seq[number] += goes_out
        message = self._message(local, self._seq[number])
        # A parity between two times says nothing; `status` keeps the last one that does.
        if message["parity"] or number not in self._latest:
            self._latest[number] = message
        if goes_out:
            self._publishers[number].put(dumps(message))

    def _message(self, local: Local, seq: int) -> Message:
        message = head(local.t_ns, seq, self._lease.epoch) | {
            "state": {}, "std": {}, "parity": {}, "parity_std": {}, "bounded": []
        }  # fmt: skip
        if not np.isfinite(local.x.sum() + local.std.sum()):
            return message
        message["state"] = dict(zip(self._states, local.x.tolist(), strict=True))
        message["std"] = dict(zip(self._errors, local.std.tolist(), strict=True))
        if local.parity is not None and np.isfinite(local.parity.sum() + local.parity_std.sum()):
            message["parity"] = dict(zip(self._shared, local.parity.tolist(), strict=True))
            message["parity_std"] = dict(zip(self._shared, local.parity_std.tolist(), strict=True))
            message["bounded"] = [
                name for name, is_bound in zip(self._shared, local.bounded, strict=True) if is_bound
            ]
        return message
