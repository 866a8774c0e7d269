"""Publishers: what of a batch of reports goes out, and how often. Commands go at the highest priority."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import zenoh
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.service import output_record
from fusiond.service.command_output import CommandOutput, Heed
from fusiond.service.health_watch import HealthWatch, Transition
from fusiond.service.lease import Lease
from fusiond.service.limiter import RateLimiter
from fusiond.service.messages import (
    EstimateMessage,
    Message,
    dumps,
    event_message,
    health_message,
    report_message,
    reset_event,
    takeover_event,
)
from fusiond.service.outlet import JSON, declare
from fusiond.service.report_rows import ReportRows
from fusiond.types import EVENTS, Action, Role, ServiceHealth, Verdict

USED = int(Verdict.USED)
REPLAYED = int(Action.REPLAYED)
RESET = int(Action.RESET)
DEAD_RECKONING = int(ServiceHealth.DEAD_RECKONING)
Say = Callable[[str, bytes, int], None]
"""Told of every JSON message that goes out: topic, bytes, time in ns (the recording)."""


class Outputs:
    """The publishers of one daemon.

    Args:
        session: gives the results out.      prefix: the namespace.
        lease: says whether anything goes out, and the epoch of what does.
        publish_hz: highest rate of `estimate` and of each `report/SENSOR`, in data time.
        record_hz: highest rate of estimates told to `say`.      commands: where commands go.
        packed: estimate and control as records instead of JSON.
        derived: numbers derived from a state vector, by name.
    """

    def __init__(
        self, session: zenoh.Session, layout: Layout, prefix: str, *, lease: Lease, publish_hz: float,
        record_hz: float, packed: bool, derived: Callable[[Any], dict[str, float]], commands: CommandOutput,
        say: Say | None = None, heed: Heed | None = None,
    ) -> None:  # fmt: skip
        self.layout = layout
        self._heed = heed
        self._lease = lease
        self.latest: Message | None = None
        self.commands = commands
        self._seq = {"estimate": 0, "health": 0, "event": 0}
        self._packed = packed
        self._derived = derived if layout.outputs else None
        self._say = say
        self._estimate_message = EstimateMessage(layout)
        self._limit, self._record_limit = RateLimiter(publish_hz), RateLimiter(record_hz)
        self._record_hz = record_hz
        self._rows = ReportRows(layout)
        # Places at the end for events, whose sensor numbers are negative.
        self._updating = [sensor.role == Role.UPDATE for sensor in layout.sensors] + [False for _ in EVENTS]
        self._update_ns: int | None = None
        self._unobserved = 0
        estimate = output_record.ESTIMATE_ENCODING if packed else JSON
        levels = zenoh.Priority
        self._publishers = {
            "estimate": declare(session, f"{prefix}/estimate", estimate, levels.INTERACTIVE_HIGH, lease),
            "health": declare(session, f"{prefix}/health", JSON, levels.DATA_HIGH, lease),
            "event": declare(session, f"{prefix}/event", JSON, levels.DATA_HIGH, lease),
        }
        self._reports = [
            declare(session, f"{prefix}/report/{sensor.name}", JSON, levels.DATA_LOW, lease)
            for sensor in layout.sensors
        ]
        self._report_limits = [RateLimiter(publish_hz) for _ in layout.sensors]
        self._report_seq = [0 for _ in layout.sensors]
        self._asked: list[int] = []
        self._parts: tuple[Any, ...] = ()

    def publish(self, reports: NDArray[Any]) -> None:
        """Send what a batch of reports gives: estimates, commands, and reports somebody listens to."""
        rows, updating = self._rows, self._updating
        raw = rows.open(reports)
        for k, (t_ns, sensor, verdict, action, service, state_t_ns, command_due) in enumerate(
            rows.heads(raw)
        ):
            updated = verdict == USED and updating[sensor]
            late = action == REPLAYED and self._update_ns is not None and t_ns < self._update_ns
            if updated and not late:
                self._update_ns = t_ns
            if action == RESET:
                self._reset(raw, k, t_ns, service)
            if command_due:  # first: an actuator waits for it
                self._control(raw, k, t_ns, service)
            if updated or service >= DEAD_RECKONING:
                self._estimate(raw, k, state_t_ns, service)
        if self._asked:
            self._send_reports(reports)

    def transition(self, change: Transition) -> None:
        """Send one `event`."""
        seq = self._next("event")
        message = event_message(
            change.t_ns, seq, self._lease.epoch, change.sensor, change.before, change.after, change.fault,
            change.model if change.sensor is None else None,
        )  # fmt: skip
        self._put_json("event", message, change.t_ns)

    def health(self, t_ns: int, watch: HealthWatch) -> None:
        """Send `health`."""
        sensors = {sensor.name: int(watch.sensors[sensor.number]) for sensor in self.layout.sensors}
        faults = {
            sensor.name: fault for sensor in self.layout.sensors if (fault := watch.faults[sensor.number])
        }
        seq = self._next("health")
        unobserved = self.layout.named(self._unobserved)
        message = health_message(
            t_ns, seq, self._lease.epoch, watch.service, sensors, faults, watch.model, unobserved
        )
        self._put_json("health", message, t_ns)

    def took_over(
        self, t_ns: int, service: int, about: Mapping[str, Any], jump: tuple[int, Mapping[str, float]]
    ) -> None:
        """Send the `event` of a take-over.

        Args:
            about: rank, cause, ...   jump: resets counted, and by how much the estimate jumps; empty: not at all.
        """
        seq = self._next("event")
        message = takeover_event(t_ns, seq, self._lease.epoch, service, about, *jump)
        self._put_json("event", message, t_ns)

    def repeat_estimate(self) -> None:
        """Send the last estimate, which was not sent when it was made, under its own number."""
        if self.latest is not None:
            self.latest |= {"seq": self._seq["estimate"], "epoch": self._lease.epoch}
            self._put_estimate(self.latest)

    def numbers(self) -> dict[str, int]:
        """The last number of every kind of message."""
        return self._seq | {"control": self.commands.count}

    def at_least(self, topic: str, seq: int) -> None:
        """Number what follows beyond another daemon's number."""
        self.shift(topic, max(0, seq - self.numbers().get(topic, seq)))

    def shift(self, topic: str, by: int) -> None:
        """Number what follows higher, or lower."""
        if topic == "control":
            self.commands.shift(by)
        elif topic in self._seq:
            self._seq[topic] += by

    def marks(self) -> dict[str, Any]:
        """What another daemon needs to go on as this one."""
        return {"seq": self.numbers(), "due_ns": self._limit.due_ns, "update_ns": self._update_ns}

    def go_on(self, marks: Mapping[str, Any]) -> None:
        """Go on from another daemon's marks."""
        for topic, seq in marks["seq"].items():
            self.shift(topic, seq - self.numbers()[topic])
        self._limit.due_ns, self._update_ns = marks["due_ns"], marks["update_ns"]

    def look_who_asks(self) -> None:
        """Find out whose reports somebody listens to; called now and then, since asking Zenoh takes time."""
        self._asked = [i for i, publisher in enumerate(self._reports) if publisher.is_heard]

    def _reset(self, raw: bytes, k: int, t_ns: int, service: int) -> None:
        resets, jump = self._rows.state(raw, k)[2:4]
        named = {slot.name: size for slot, size in zip(self.layout.errors, jump, strict=True)}
        message = reset_event(t_ns, self._next("event"), self._lease.epoch, service, resets, named)
        self._put_json("event", message, t_ns)

    def _estimate(self, raw: bytes, k: int, t_ns: int, service: int) -> None:
        goes_out = self._limit.passes(t_ns)
        goes_down = self._say is not None and self._record_hz > 0 and self._record_limit.passes(t_ns)
        if not (goes_out or goes_down):
            return
        x, std, resets, jump, self._unobserved = self._rows.state(raw, k)
        seq = self._next("estimate") if goes_out else self._seq["estimate"]
        derived = self._derived(np.array(x)) if self._derived else None
        message = self._estimate_message.content(
            t_ns,
            seq,
            self._lease.epoch,
            resets,
            jump,
            x,
            std,
            service,
            derived,
            self._rows.protection(raw, k),
            self._unobserved,
        )
        self.latest = message
        if goes_out and self._heed is not None:
            self._heed("estimate", message)
        self._parts = (resets, jump, x, std, service)
        if goes_out:
            self._put_estimate(message)
        if goes_down and self._say:
            self._say("estimate", dumps(message), t_ns)

    def _put_estimate(self, message: Message) -> None:
        if self._packed:
            head = (message["t_ns"], message["seq"], message["epoch"])
            self._publishers["estimate"].put(output_record.encode_estimate(*head, *self._parts))
        else:
            self._publishers["estimate"].put(dumps(message))

    def _control(self, raw: bytes, k: int, t_ns: int, service: int) -> None:
        valid, u = self._rows.command(raw, k)
        if self._update_ns is None:
            self._update_ns = t_ns  # counted from the start, as the engine does
        self.commands.send(t_ns, u, valid, max(0, t_ns - self._update_ns) / 1e9, service)

    def _send_reports(self, reports: NDArray[Any]) -> None:
        for number in self._asked:
            for report in reports[reports["sensor"] == number]:
                if self._report_limits[number].passes(int(report["t_ns"])):
                    self._report_seq[number] += 1
                    message = report_message(report, self.layout, self._report_seq[number], self._lease.epoch)
                    self._reports[number].put(dumps(message))

    def _put_json(self, topic: str, message: Message, t_ns: int) -> None:
        payload = dumps(message)
        self._publishers[topic].put(payload)
        if self._say:
            self._say(topic, payload, t_ns)

    def _next(self, topic: str) -> int:
        self._seq[topic] += 1
        return self._seq[topic]
