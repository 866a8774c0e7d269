"""Who of several daemons speaks: decided by each for itself, from what it sees of the others.

Theory of operation. Each daemon of a group shows a token with its rank; that of the one that speaks, the active, also
carries its epoch, and it gives a sign of life ten times in `term_ns`. What a daemon does, at every look:

| it is | it sees | it does |
|---|---|---|
| standby | an active that gives signs of life | stays |
| standby | the active's token gone | takes over; after its betters in rank, each of which has `limit_ns` to do so |
| standby | an active without a sign of life for `limit_ns` | takes over, in the same order |
| standby | no active, and it has just started, or come back | takes over after `settle_ns`, and half for each rank |
| active | an active with a stronger claim, or outside of any group | steps down |
| active | that it was away itself for `term_ns`, and others are there, or were before | steps down |

The stronger claim is the later epoch, of equal ones the lower rank: consumers follow the latest epoch, so that the one
they already believe goes on. A daemon that was away (stopped, starved) has seen nothing of what happened meanwhile, and
its own links may have been closed by the others: for `settle_ns` after it is back, nobody's absence is evidence.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from enum import Enum

SETTLE_NS = 1_000_000_000
"""Time until a silent link is taken for cut, longer than any pause between two tries to connect (`sessions`)."""


class Move(Enum):
    """What is to be done."""

    STAY = "stay"
    TAKE_OVER = "take over"
    STEP_DOWN = "step down"


@dataclass(frozen=True, slots=True)
class Member:
    """One daemon as the others see it.

    Args:
        epoch: since when it speaks, None: it stands by.
        pulses: whether it gives signs of life; a daemon outside of any group does not.
    """

    rank: int
    id: str
    epoch: int | None = None
    pulses: bool = True

    @property
    def claim(self) -> tuple[int, int, str]:
        """The larger one speaks."""
        return (-1 if self.epoch is None else self.epoch, -self.rank, self.id)


class Election:
    """The part of one daemon.

    Args:
        limit_ns: longest time without a sign of life of an active.   settle_ns: time in which links are made.
    `epoch` is set by whoever carries out a move; None: this daemon stands by. `leader`: the active last seen.
    `term_ns`: how long an active may speak after a look: less than both times after which others take it for gone,
    since they count from its last sign of life, up to a tenth of a term before the look.
    `cause`: of the last take-over: `gone`, `silent`, or `first`, where there was nobody to take over from.
    """

    def __init__(self, rank: int, id: str, limit_ns: int, settle_ns: int = SETTLE_NS) -> None:
        self.rank, self.id, self.limit_ns, self.settle_ns = rank, id, limit_ns, settle_ns
        self.epoch: int | None = None
        self.leader: Member | None = None
        self.cause = "first"
        self.term_ns = min(limit_ns, settle_ns) * 4 // 5
        self._looked_ns: int | None = None
        self._accompanied = False
        self._heard_ns = 0
        self._nobody_since_ns: int | None = None
        self._back_ns: int | None = None

    def look(self, now_ns: int, members: Collection[Member], signs: Collection[str]) -> Move:
        """Decide.

        Args:
            members: all whose tokens are there, this one among them or not.
            signs: ids of those that gave a sign of life since the last look.
        """
        away_ns = 0 if self._looked_ns is None else now_ns - self._looked_ns
        self._looked_ns = now_ns
        others = [one for one in members if one.id != self.id]
        # Its links may have been cut meanwhile: who was there before counts as there.
        accompanied, self._accompanied = bool(others) or self._accompanied, bool(others)
        leader = max((one for one in others if one.epoch is not None), key=lambda m: m.claim, default=None)
        if self.epoch is not None:
            mine = Member(self.rank, self.id, self.epoch)
            stronger = leader is not None and leader.claim > mine.claim
            if not stronger and not (accompanied and away_ns > self.term_ns):
                return Move.STAY
            self.leader, self._heard_ns, self._nobody_since_ns = leader, now_ns, None
            self._back_ns = now_ns
            return Move.STEP_DOWN
        if away_ns > self.limit_ns // 2:
            self._back_ns = now_ns
        turn = sum(one.epoch is None and (one.rank, one.id) < (self.rank, self.id) for one in others)
        return self._stand_by(now_ns, leader, turn, signs)

    def _stand_by(self, now_ns: int, leader: Member | None, turn: int, signs: Collection[str]) -> Move:
        """As a standby with so many betters in rank."""
        if leader is not None:
            known = self.leader is not None and self.leader.id == leader.id
            if now_ns == self._back_ns or not known or leader.id in signs or not leader.pulses:
                self._heard_ns = now_ns
            self.leader, self._nobody_since_ns = leader, None
            self.cause = "silent"
            return self._after(now_ns - self._heard_ns, (1 + turn) * self.limit_ns)
        if self._back_ns is not None and now_ns - self._back_ns < self.settle_ns:
            self.leader = None
        if self._nobody_since_ns is None:
            self._nobody_since_ns = now_ns
        self.cause = "first" if self.leader is None else "gone"
        first_ns = self.settle_ns + self.rank * self.settle_ns // 2
        wait_ns = turn * self.limit_ns if self.leader is not None else first_ns
        return self._after(now_ns - self._nobody_since_ns, wait_ns)

    @staticmethod
    def _after(passed_ns: int, wait_ns: int) -> Move:
        return Move.TAKE_OVER if passed_ns >= wait_ns else Move.STAY
