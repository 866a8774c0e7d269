"""Complaints: what senders, load and disk do wrong, said when its count has grown, with what to do about it."""

from __future__ import annotations

from fusiond.recording.refusals import Refusals
from fusiond.service.command_output import CommandOutput
from fusiond.service.mailbox import Mailbox
from fusiond.service.recorder import Recorder
from fusiond.service.telemetry import Voice


class Complaints:
    """The complaints of one daemon.

    Args:
        refusals: what came in and was no reading.   mailbox: counts the puts that found it full.
        commands: counts those missed.   deadline_s: by which they are.   recorder: has its `error`.
    """

    def __init__(
        self, voice: Voice, refusals: Refusals, mailbox: Mailbox, commands: CommandOutput, deadline_s: float | None,
        recorder: Recorder | None,
    ) -> None:  # fmt: skip
        self._voice, self._refusals, self._mailbox = voice, refusals, mailbox
        self._commands, self._deadline_s, self._recorder = commands, deadline_s, recorder
        self._said: dict[str, int] = {}

    def look(self, now_ns: int) -> None:
        """Say what has grown since it was last said."""
        for verdict, count in self._refusals.counts.items():
            first = self._refusals.first[verdict]
            self._complain(
                f"refused {verdict.label}", count, now_ns,
                f"intake: {count} refused as {verdict.label}, the first from {first}; correct the sender",
            )  # fmt: skip
        missed, dropped = self._commands.missed, self._mailbox.dropped
        self._complain(
            "late", missed, now_ns,
            f"control: {missed} safe commands sent because the loop was late (limit {self._deadline_s} s); "
            "lighten the load, or raise control.deadline_s",
        )  # fmt: skip
        self._complain(
            "dropped", dropped, now_ns,
            f"intake: {dropped} puts dropped (limit {self._mailbox.capacity} waiting); pack several readings in a put, "
            "or raise service.ring",
        )  # fmt: skip
        if self._recorder is not None and self._recorder.error:
            self._voice.warn("recording", now_ns, self._recorder.error)

    def _complain(self, kind: str, count: int, now_ns: int, text: str) -> None:
        if count != self._said.get(kind, 0) and self._voice.warn(kind, now_ns, text):
            self._said[kind] = count
