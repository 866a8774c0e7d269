"""The daemon's life: startup, main_loop, shutdown. All state belongs to who holds the mailbox's baton."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Any

import numpy as np
import zenoh
from numpy.typing import NDArray

from fusiond.engine.noise_learnt import Learnt, learnt, recall
from fusiond.engine.records import HAS_ARRIVAL
from fusiond.service.admin import Admin
from fusiond.service.clock import Clock
from fusiond.service.command_output import CommandOutput, fallback_of
from fusiond.service.command_watch import CommandWatch
from fusiond.service.complaints import Complaints
from fusiond.service.cost_watch import CostWatch
from fusiond.service.counters import Counters
from fusiond.service.group import Group
from fusiond.service.handover import Handover
from fusiond.service.health_watch import HealthWatch, Transition
from fusiond.service.intake import Intake
from fusiond.service.lease import Lease
from fusiond.service.local_outputs import LocalOutputs
from fusiond.service.mailbox import Arrival, Mailbox
from fusiond.service.node_watch import NodeWatch
from fusiond.service.notify import Notifier
from fusiond.service.outputs import Outputs
from fusiond.service.recorder import Recorder
from fusiond.service.report_ring import ReportRing
from fusiond.service.sessions import Sessions, open_sessions
from fusiond.service.settings import Settings, settings_of
from fusiond.service.status import configuration, status
from fusiond.service.telemetry import Voice
from fusiond.service.ticks import Ticks
from fusiond.service.tracklet_outputs import TrackletOutputs
from fusiond.service.transition_words import words_of
from fusiond.service.why import why
from fusiond.service.wire import Decoder, take
from fusiond.types import RESET, TICK, seconds

HOUSEKEEPING_NS = 1_000_000_000
LONGEST_WAIT_NS = 100_000_000
"""Longest sleep of the loop: a stop, and the watchdog, never wait longer."""
JOIN_S = 0.2


class Daemon:
    """One running configuration.

    Args:
        assembly: gives `config`, `layout` and a fresh `engine()`.
        listen, connect: endpoints instead of the configuration's; empty: as configured.
        known_noise: what an earlier run learnt of the sensors' noise.
        rank: in a group of daemons, instead of the configuration's.
    """

    def __init__(
        self, assembly: Any, *, listen: Sequence[str] = (), connect: Sequence[str] = (),
        recorder: Recorder | None = None, voice: Voice, clock: Clock | None = None, notifier: Notifier | None = None,
        known_noise: Learnt | None = None, rank: int | None = None,
    ) -> None:  # fmt: skip
        self.assembly = assembly
        self.settings: Settings = settings_of(assembly.config, assembly.layout, listen, connect, rank)
        self.clock = clock or Clock()
        self.voice = voice
        self._recorder = recorder
        self._known_noise = known_noise or {}
        self._notifier = notifier or Notifier()
        self._stopping = False
        self.preparing = False
        self._failure: Exception | None = None
        self._bell: SimpleQueue[None] = SimpleQueue()
        self.mailbox = Mailbox(self.settings.ring, self._work)
        self._opened: Sessions | None = None
        self._group: Group | None = None
        self._command_watch: CommandWatch | None = None
        self._threads_end: list[Callable[[float], bool]] = []

    def stop(self) -> None:
        """End the loop after the round it is in; allowed in a signal handler, as `SimpleQueue.put` is."""
        self._stopping = True
        self._wake()

    def _wake(self) -> None:
        self._bell.put(None)

    def startup(self) -> tuple[str, ...]:
        """Compile, open, subscribe, and only then declare to be alive.

        Returns: the endpoints where clients reach the daemon.
        Raises: ConnectionFailed.
        """
        settings, layout = self.settings, self.assembly.layout
        self.preparing = True
        if not self.assembly.is_compiled:
            self.voice.info("compiling the filter, once for this configuration; up to half a minute")
        self.assembly.prepare()
        self.engine = self.assembly.engine()
        recall(self.engine, self._known_noise)
        self._resets: NDArray[np.int64] = self.engine.track["resets"]
        self.preparing = False
        self.started_ns = self.clock.now_ns()
        alone = settings.rank is None
        self.lease = Lease(self.started_ns // 1_000_000, held=alone, clock=self.clock)
        self._decoder, self._counters, self._watch = Decoder(layout), Counters(layout), HealthWatch(layout)
        self._nodes, self._ring = NodeWatch(layout, settings.nodes), ReportRing(layout)
        self._event = np.zeros(1, layout.reading)
        self._event["flags"] = HAS_ARRIVAL
        self._ticks, self._housekeeping_due_ns = Ticks(self.engine.desk, settings.tick_hz), 0
        self._opened = self.sessions = open_sessions(
            settings.mode, settings.listen, settings.connect, multicast=settings.multicast,
            told=settings.told, give_up=lambda: self._stopping,
        )  # fmt: skip
        self._open_keys()
        return self.sessions.endpoints

    def learnt_noise(self) -> Learnt:
        """What has been learnt of the sensors' noise; empty before startup."""
        return self._known_noise if self._opened is None else learnt(self.engine)

    def main_loop(self) -> None:
        """Meet one deadline after the other until told to stop; readings are worked off by who brings them.

        Raises: what ended the work.
        """
        while not self._stopping:
            self.round()
        if self._failure is not None:
            raise self._failure

    def shutdown(self) -> bool:
        """Close everything. False where a thread did not end, which must not keep the process."""
        self._notifier.stopping()
        if self._opened is None:
            return True
        ended = [self._command_watch is None or self._command_watch.close(JOIN_S)]
        with self.mailbox.baton:
            self._opened.close()
        ended += [end(JOIN_S) for end in self._threads_end]
        return all(ended)

    def round(self) -> None:
        """Wait for the next deadline or the bell; then, with the baton, answer, let time pass, keep house."""
        now_ns = self.clock.now_ns()
        due_ns = min(self._ticks.due_ns, self._housekeeping_due_ns, now_ns + LONGEST_WAIT_NS)
        with suppress(Empty):
            self._bell.get(timeout=max(0, due_ns - now_ns) / 1e9)
        with self.mailbox.baton:
            for admin in self._admins:
                admin.answer_pending()
            now_ns = self.clock.now_ns()
            if self._group is not None:
                self._group.look(now_ns)
            if now_ns >= self._ticks.due_ns and not len(self.mailbox):
                self._let_time_pass(now_ns)
            if now_ns >= self._housekeeping_due_ns:
                self._keep_house(now_ns)
            self._notifier.went_round(now_ns)
        # A reader that met the baton in our hand left its arrival to us.
        self.mailbox.work_off()

    def _open_keys(self) -> None:
        settings, layout = self.settings, self.assembly.layout
        self._cost = CostWatch(self.assembly, self.engine)
        self._commands = CommandOutput(
            self.sessions.control, layout, settings.prefix, lease=self.lease, packed=settings.packed,
            fallback=fallback_of(self.assembly.design[0]), say=self._say if self._recorder else None,
            costs=self._cost.told, heed=self._heed,
        )  # fmt: skip
        self._outputs = Outputs(
            self.sessions.control, layout, settings.prefix, lease=self.lease, publish_hz=settings.publish_hz,
            record_hz=settings.record_hz, packed=settings.packed, derived=self.engine.outputs,
            commands=self._commands, say=self._say if self._recorder else None, heed=self._heed,
        )  # fmt: skip
        self._complaints = Complaints(
            self.voice,
            self._decoder.refusals,
            self.mailbox,
            self._commands,
            settings.deadline_s,
            self._recorder,
        )
        self._locals = LocalOutputs(
            self.sessions.control, self.engine, settings.prefix, lease=self.lease, publish_hz=settings.publish_hz,
        )  # fmt: skip
        self._tracklets = TrackletOutputs(self.sessions.control, self.assembly, settings.sends, self.lease)
        self._handover = Handover(self.assembly, self.engine, self._outputs, self._watch)
        self._open_answers()
        with self.mailbox.baton:  # nobody works before all is there
            self._intake = Intake(
                self.sessions.sensors, layout, settings.prefix, settings.keys, settings.ring, self.mailbox,
                self.clock,
            )  # fmt: skip
        self._threads_end.append(self._intake.join)
        self._show_alive()
        if settings.deadline_s is not None:
            self._command_watch = CommandWatch(self._commands, round(settings.deadline_s * 1e9), self.clock)
            self._command_watch.start()
        self._notifier.ready()

    def _open_answers(self) -> None:
        """Answer questions; those to the active daemon of a group only while that is this one."""
        settings = self.settings
        answers = {
            "status": self._status, "why": self._why, "config": self._config, "command/reset": self._reset,
            "checkpoint": lambda _: self._handover.give(),
        }  # fmt: skip
        alone, session = settings.rank is None, self.sessions.admin
        self._admins = [Admin(session, settings.prefix, answers, self._wake, open=alone)]
        if not alone:
            own = f"{settings.prefix}/member/{settings.rank}"
            asked = {what: answers[what] for what in ("status", "why", "config")}
            self._admins.append(Admin(session, own, asked, self._wake))
        self._threads_end += [admin.close for admin in self._admins]

    def _show_alive(self) -> None:
        """Show that readings are taken: as a daemon alone, or as one of a group."""
        settings, session = self.settings, self.sessions.control
        if settings.rank is None:
            key = f"{settings.prefix}/alive/fusion/{session.zid()}"
            self._token: zenoh.LivelinessToken = session.liveliness().declare_token(key)
            return
        with self.mailbox.baton:
            self._group = Group(
                session, settings.prefix, settings.rank, settings.takeover_ns, body=self, lease=self.lease,
                outputs=self._outputs, handover=self._handover, voice=self.voice, wake=self._wake,
            )  # fmt: skip

    def answer(self, *, active: bool) -> None:
        """Begin or cease to answer questions to the active daemon."""
        if active:
            self._admins[0].open()
        else:
            self._admins[0].withdraw()

    def drain(self) -> None:
        """Work off what waits; called with the baton."""
        self.mailbox.drain()

    def process_late(self, readings: NDArray[Any]) -> None:
        """Take readings that were collected; called with the baton."""
        self._counters.note(readings, self._process(readings))

    def _heed(self, topic: str, content: Mapping[str, Any]) -> None:
        """What is said, or would be said by a standby."""
        if self._group is not None:
            self._group.said(topic, content)

    def _work(self, arrivals: list[Arrival]) -> None:
        """Take arrivals, in order; called with the baton, by whichever reader brought the last of them."""
        if self._stopping:
            return
        try:
            readings = take(arrivals, self._intake.sensor_of, self._decoder)
            if len(readings):
                if self._group is not None:
                    self._group.note(readings)
                reports = self._process(readings)
                self._counters.note(readings, reports)
        except Exception as error:
            self._failure = error
            self.stop()

    def _process(self, readings: NDArray[Any]) -> NDArray[Any]:
        reports: NDArray[Any] = self.engine.process(readings)
        self._outputs.publish(reports)
        self._tracklets.publish(readings, reports)
        self._locals.publish(reports)
        changes = self._watch.observe(reports)
        self._ring.note(reports, changes)
        for change in changes:
            self._outputs.transition(change)
            self._tell(change)
            self._housekeeping_due_ns = 0
        if changes:
            self._cost.observe(self._watch.sensors)
        for text in self._nodes.observe(self._watch.sensors):
            self.voice.info(text, t_s=int(reports["t_ns"][-1]) / 1e9)
        if self._recorder is not None:
            self._recorder.put_readings(readings)
            self._recorder.put_reports(reports)
        return reports

    def _let_time_pass(self, now_ns: int) -> None:
        t_ns = self._ticks.stamp_ns(now_ns)
        if t_ns is not None:
            self._counters.ticks += 1
            self._happen(TICK, t_ns, now_ns)

    def _happen(self, event: int, t_ns: int, now_ns: int) -> None:
        """Process an event like a reading: a replay of the recording meets it at the same place."""
        self._event["sensor"], self._event["t_ns"], self._event["arrival_ns"] = event, t_ns, now_ns
        self._process(self._event)

    def _keep_house(self, now_ns: int) -> None:
        """Once a second, and after every change of health."""
        self._housekeeping_due_ns = now_ns + HOUSEKEEPING_NS
        if self.lease.held:
            self._outputs.health(int(self.engine.desk["newest_t_ns"][0]), self._watch)
        self._outputs.look_who_asks()
        self._cost.observe(self._watch.sensors)
        self._locals.look_who_asks()
        self._counters.rate(now_ns)
        self._complaints.look(now_ns)

    def _tell(self, change: Transition) -> None:
        number = self.assembly.layout.numbers[change.sensor] if change.sensor else 0
        subject = self._nodes.subject(change.sensor) if change.sensor else "service"
        silence_s = seconds(int(self.assembly.design["silence_ns"][0, number]))
        self.voice.info(words_of(change, subject, silence_s), t_s=change.t_ns / 1e9)

    def _say(self, topic: str, payload: bytes, t_ns: int) -> None:
        assert self._recorder is not None
        if self.lease.valid:
            self._recorder.put_message(topic, payload, t_ns, self.clock.now_ns())

    def _status(self, _: Mapping[str, Any]) -> dict[str, Any]:
        return status(
            config=self.assembly.config, mode=self.settings.mode, endpoints=self.sessions.endpoints,
            epoch=self.lease.epoch, uptime_s=(self.clock.now_ns() - self.started_ns) / 1e9,
            resets=self._resets.item(), counters=self._counters,
            decoder=self._decoder, watch=self._watch, mailbox=self.mailbox, latest=self._outputs.latest,
            parity=self._locals.status(), repairs=self.engine.repairs, guard=self.engine.guard(),
            state_sha256=self.engine.state_sha256(),
            recorder=self._recorder, noise=learnt(self.engine),
            control={
                "level": self._commands.level, "commands": self._commands.count, "missed": self._commands.missed,
                **self._cost.told(),
            },
        ) | self._part_status()  # fmt: skip

    def _part_status(self) -> dict[str, Any]:
        """What this machine is among several."""
        return {
            "role": self.settings.role,
            "nodes": self._nodes.status(),
            "withheld": self._tracklets.withheld,
            "group": None if self._group is None else self._group.status(),
        }

    def _why(self, asked: Mapping[str, Any]) -> dict[str, Any]:
        return why(self._ring, self.assembly.layout, asked)

    def _config(self, _: Mapping[str, Any]) -> dict[str, Any]:
        return configuration(self.assembly.config, self.assembly.layout)

    def _reset(self, _: Mapping[str, Any]) -> dict[str, Any]:
        """Let the state start again with the next reading; held inputs, sequence numbers and the reference stay."""
        self._happen(RESET, int(self.engine.desk["newest_t_ns"][0]), self.clock.now_ns())
        self.voice.info("command: reset; the state starts again with the next reading")
        return {"done": "reset", "resets": self._resets.item()}
