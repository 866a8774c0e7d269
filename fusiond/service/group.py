"""One daemon among several of the same configuration: stands by in step with the active one, and takes over from it.

All of them hear the same readings and compute the same, so that a take-over needs nothing from whoever is gone. Who
speaks is decided in `election`; that only one does is held by `lease`; how a latecomer comes into step in `catch_up`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from queue import Empty, SimpleQueue
from typing import Any, Protocol

import zenoh
from numpy.typing import NDArray

from fusiond.service.catch_up import CatchUp, missing
from fusiond.service.election import Election, Member, Move
from fusiond.service.handover import Handover
from fusiond.service.lease import Lease
from fusiond.service.members import TOPICS, Members
from fusiond.service.outputs import Outputs
from fusiond.service.telemetry import Voice
from fusiond.service.twin import SAID, Twin, close, estimate_said, said_in

PULSES = 10
"""Signs of life in the time that a lease lasts."""
OUT_OF_STEP_NS = 1_000_000_000
"""How long a standby may differ before it asks for another checkpoint: late readings make it differ for a moment."""
ASK_S = 2.0


class Body(Protocol):
    """What a group needs of its daemon."""

    engine: Any

    def process_late(self, readings: NDArray[Any]) -> None:
        """Take readings that were collected."""

    def drain(self) -> None:
        """Work off what waits."""

    def answer(self, *, active: bool) -> None:
        """Begin or cease to answer questions to the active daemon."""


class Group:
    """The part of one daemon; all is called with the baton.

    Args:
        limit_ns: longest time without a sign of life of the active daemon.
    """

    def __init__(
        self, session: zenoh.Session, prefix: str, rank: int, limit_ns: int, *, body: Body, lease: Lease,
        outputs: Outputs, handover: Handover, voice: Voice, wake: Callable[[], None],
    ) -> None:  # fmt: skip
        self.in_step = False
        self.takeovers: list[dict[str, Any]] = []
        self._session, self._prefix, self._wake = session, prefix, wake
        self._body, self._lease, self._outputs, self._handover = body, lease, outputs, handover
        self._voice = voice
        self._members = Members(session, prefix, lease, wake)
        self._election = Election(rank, self._members.id, limit_ns)
        self._twins = {"estimate": Twin(), "control": Twin()}
        self._heard: dict[str, Mapping[str, Any]] = {}
        self._differs_since_ns: int | None = None
        self._catch_up = CatchUp()
        self._answers: SimpleQueue[bytes] = SimpleQueue()
        self._pulse_due_ns = 0
        self._members.show(self._me)

    @property
    def _me(self) -> Member:
        return Member(self._election.rank, self._members.id, self._election.epoch)

    def note(self, readings: NDArray[Any]) -> None:
        """Readings that are about to be processed."""
        self._catch_up.note(readings)

    def said(self, topic: str, content: Mapping[str, Any]) -> None:
        """What this daemon says, or would say."""
        if not self._lease.held:
            self._twins[topic].note(SAID[topic](content))

    def look(self, now_ns: int) -> None:
        """One look at the others, and what follows from it."""
        signs, members = self._members.signs(), self._members.now()
        move = self._election.look(now_ns, members, signs)
        if move is Move.TAKE_OVER:
            self._take_over(now_ns)
        elif move is Move.STEP_DOWN:
            self._step_down()
        if self._lease.held:
            others = any(one.id != self._members.id for one in members)
            self._lease.renew(now_ns + self._election.term_ns if others else None)
            if now_ns >= self._pulse_due_ns or move is Move.TAKE_OVER:
                self._pulse_due_ns = now_ns + self._election.term_ns // PULSES
                self._members.pulse(self._me, self._outputs.numbers())
        else:
            self._follow(now_ns, signs)

    def status(self) -> dict[str, Any]:
        """This daemon among the others."""
        members = sorted(self._members.now(), key=lambda m: (m.rank, m.id))
        return {
            "rank": self._election.rank,
            "state": _state(self._me),
            "in_step": self.in_step or self._lease.held,
            "members": [{"rank": m.rank, "state": _state(m), "epoch": m.epoch, "id": m.id} for m in members],
            "takeovers": self.takeovers[-1:],
        }

    def _follow(self, now_ns: int, signs: Mapping[str, Mapping[str, int]]) -> None:
        """Stay in step with the active daemon, where there is one."""
        leader = self._election.leader
        if leader is None or leader.epoch is None:
            return
        for topic, seq in signs.get(leader.id, {}).items():
            self._outputs.at_least(topic, seq)
        for topic in TOPICS:
            self._listen(topic, leader.epoch if leader.pulses else 0, now_ns)
        since = self._differs_since_ns
        if since is not None and now_ns - since >= OUT_OF_STEP_NS:
            self.in_step = False
        if not self.in_step:
            self._catch_up.begin(now_ns)
        if self._catch_up.due(now_ns):
            self._ask()
        self._adopt(now_ns)

    def _listen(self, topic: str, epoch: int, now_ns: int) -> None:
        """Take the newest message of the active daemon on a topic; compare it where it can be."""
        content = self._members.said(topic)
        if content is None or content["epoch"] < epoch:
            return
        if topic not in self._twins:
            self._heard[topic] = content
            self._outputs.at_least(topic, content["seq"])
            return
        other = said_in(topic, content)
        if other is None:
            return
        self._heard[topic] = content
        own = self._twins[topic].beside(other)
        if own is None:
            self._outputs.at_least(topic, other.seq)
            return
        self._outputs.shift(topic, other.seq - own.seq)
        self._twins[topic].shift(other.seq - own.seq)
        if close(own, other):
            self._differs_since_ns = None
        elif self._differs_since_ns is None:
            self._differs_since_ns = now_ns

    def _ask(self) -> None:
        """Ask the active daemon for a checkpoint; the answer comes on a thread of Zenoh's."""

        def take(reply: zenoh.Reply) -> None:
            if reply.ok is not None:
                self._answers.put(reply.ok.payload.to_bytes())
                self._wake()

        handler = zenoh.handlers.Callback(take, indirect=False)
        self._session.get(f"{self._prefix}/checkpoint", handler, timeout=ASK_S)

    def _adopt(self, now_ns: int) -> None:
        """Go on from a checkpoint that has come, and from the readings that are not in it."""
        try:
            data = self._answers.get_nowait()
        except Empty:
            return
        if not self._catch_up.is_running:
            return
        collected = self._catch_up.end(now_ns)
        try:
            self._handover.take(data)
        except ValueError as error:
            self._voice.warn("checkpoint", now_ns, f"group: its checkpoint is {error}; start all alike")
            return
        for twin in self._twins.values():
            twin.clear()
        self._differs_since_ns, self.in_step = None, True
        late = missing(collected, self._body.engine.memory()["ring"])
        if late is not None:
            self._body.process_late(late)
        self._voice.info("group: in step with the active daemon", late=0 if late is None else len(late))

    def _take_over(self, now_ns: int) -> None:
        """Speak from now on: numbers go on, the epoch is a later one, a jump is published as of a reset."""
        self._body.drain()
        before, cause = self._election.leader, self._election.cause
        least = -1 if before is None or before.epoch is None or not before.pulses else before.epoch
        for topic in TOPICS:
            self._listen(topic, least, now_ns)
        epochs = [content["epoch"] for content in self._heard.values()]
        epoch = max(now_ns // 1_000_000, least + 1, *(one + 1 for one in epochs))
        self._election.epoch = epoch
        self._lease.take(epoch)
        self._members.show(self._me)
        self._body.answer(active=True)
        jump = self._jump()
        about = {"rank": self._election.rank, "cause": cause, "in_step": self.in_step, "epoch": epoch}
        if before is not None:
            about |= {"from_rank": before.rank, "from_epoch": before.epoch}
            self._handover.announce(about, jump)
            self.takeovers.append(about)
        self._voice.info(
            f"group: active from now on, rank {self._election.rank}; {CAUSES[cause]}", epoch=epoch
        )
        if not jump[1]:
            self._repeat_unsaid()
        self._heard.clear()

    def _repeat_unsaid(self) -> None:
        """Send the newest estimate and command where they are newer than those the daemon before has sent."""
        numbers = self._outputs.numbers()
        newer = {topic: numbers[topic] > self._heard.get(topic, {"seq": 0})["seq"] for topic in self._twins}
        if newer["control"]:
            self._outputs.commands.repeat()
        if newer["estimate"]:
            self._outputs.repeat_estimate()

    def _jump(self) -> tuple[int, dict[str, float]]:
        """How the estimate jumps with this take-over, and the number of resets then; written into the records."""
        if "estimate" not in self._heard:
            return 0, {}
        other = estimate_said(self._heard["estimate"])
        own = self._twins["estimate"].beside(other)
        jump = {} if own is None else self._handover.jump(own, other)
        if own is None or not jump:
            return other.resets, {}
        resets = max(own.resets, other.resets) + 1
        self._handover.reset(jump, resets)
        return resets, jump

    def _step_down(self) -> None:
        self._lease.give_up()
        self._election.epoch = None
        self._body.answer(active=False)
        self._members.show(self._me)
        self.in_step, self._differs_since_ns = False, None
        for twin in self._twins.values():
            twin.clear()
        leader = self._election.leader
        why = "it was held up" if leader is None else f"rank {leader.rank} speaks since {leader.epoch}"
        self._voice.info(f"group: standby from now on; {why}")


CAUSES = {
    "first": "nobody else is",
    "gone": "the daemon before is gone",
    "silent": "the daemon before gives no sign of life",
}


def _state(member: Member) -> str:
    return "standby" if member.epoch is None else "active"
