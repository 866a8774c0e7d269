"""The daemons of one group on the network: their tokens, their signs of life, and what the active one says.

Tokens: `alive/fusion/RANK-EPOCH-ID` of the active, `alive/standby/RANK-ID` of the others; `alive/fusion/ID` is a daemon
outside of any group. Signs of life: `pulse {id, rank, epoch, seq{}}`, seq by topic the last number sent.
"""

from __future__ import annotations

import json
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import zenoh

from fusiond.service.election import Member
from fusiond.service.lease import Lease
from fusiond.service.messages import dumps
from fusiond.service.outlet import JSON, declare
from fusiond.service.tracklet_outputs import content_of

TOPICS = ("estimate", "control", "health", "event")
HEAD = ("t_ns", "seq", "epoch")
"""What every message carries."""
LARGEST = 2**62
"""No stamp or number of a daemon comes near it: what is larger would not fit where one counts on from it."""
PULSES = 16
"""Signs of life kept between two looks."""
REMOTE = zenoh.Locality.REMOTE


def token_of(member: Member) -> str:
    """Its liveliness token, under the namespace."""
    if member.epoch is None:
        return f"alive/standby/{member.rank}-{member.id}"
    return f"alive/fusion/{member.rank}-{member.epoch}-{member.id}"


def member_of(key: str) -> Member | None:
    """Whose token a key is; None where it is nobody's."""
    role, _, name = key.rpartition("/alive/")[2].partition("/")
    match role, name.split("-"):
        case "fusion", [rank, epoch, one] if rank.isdigit() and epoch.isdigit():
            return Member(int(rank), one, int(epoch))
        case "fusion", [one] if one:
            # It knows of nobody and never steps down: its claim is the strongest.
            return Member(0, one, sys.maxsize, pulses=False)
        case "standby", [rank, one] if rank.isdigit():
            return Member(int(rank), one)
    return None


class Members:
    """What one daemon sees of its group, and shows of itself.

    Args:
        session: whose id this daemon's is.   wake: called whenever a token comes or goes.
    """

    def __init__(self, session: zenoh.Session, prefix: str, lease: Lease, wake: Callable[[], None]) -> None:
        self.id = str(session.zid())
        self._session, self._prefix, self._wake = session, prefix, wake
        self._lock = threading.Lock()
        self._seen: dict[str, Member] = {}
        self._token: zenoh.LivelinessToken | None = None
        self._pulse = declare(session, f"{prefix}/pulse", JSON, zenoh.Priority.INTERACTIVE_HIGH, lease)
        ring = zenoh.handlers.RingChannel
        self._pulses = session.declare_subscriber(f"{prefix}/pulse", ring(PULSES), allowed_origin=REMOTE)
        self._said = {
            topic: session.declare_subscriber(f"{prefix}/{topic}", ring(1), allowed_origin=REMOTE)
            for topic in TOPICS
        }
        # A direct callback only writes into a dictionary: a token that goes must be known at once.
        handler = zenoh.handlers.Callback(self._take, indirect=False)
        self._watch = session.liveliness().declare_subscriber(f"{prefix}/alive/*/*", handler, history=True)

    def show(self, member: Member) -> None:
        """Show this daemon's token; the one before goes after it has come."""
        before = self._token
        self._token = self._session.liveliness().declare_token(f"{self._prefix}/{token_of(member)}")
        if before is not None:
            before.undeclare()

    def now(self) -> list[Member]:
        """All whose tokens are there."""
        with self._lock:
            return list(self._seen.values())

    def pulse(self, member: Member, seq: Mapping[str, int]) -> None:
        """Give a sign of life."""
        about = {"id": member.id, "rank": member.rank, "epoch": member.epoch, "seq": dict(seq)}
        self._pulse.put(dumps(about))

    def signs(self) -> dict[str, dict[str, int]]:
        """Who gave a sign of life since this was last asked, with the numbers it had reached."""
        found = {}
        while (sample := self._pulses.try_recv()) is not None:
            with suppress(ValueError, TypeError, KeyError, RecursionError, OverflowError):
                content = json.loads(sample.payload.to_bytes())
                found[str(content["id"])] = {
                    str(topic): int(seq) for topic, seq in dict(content["seq"]).items()
                }
        return found

    def said(self, topic: str) -> Mapping[str, Any] | None:
        """The newest message on a topic that came since this was last asked, None where none did."""
        sample = self._said[topic].try_recv()
        if sample is None:
            return None
        try:
            content: Any = content_of(sample)
        except (ValueError, RecursionError):
            return None
        if not isinstance(content, dict):
            return None
        numbers = [content.get(name) for name in HEAD]
        return content if all(isinstance(one, int) and 0 <= one <= LARGEST for one in numbers) else None

    def _take(self, sample: zenoh.Sample) -> None:
        key = str(sample.key_expr)
        member = member_of(key)
        if member is None:
            return
        with self._lock:
            if sample.kind == zenoh.SampleKind.PUT:
                self._seen[key] = member
            else:
                self._seen.pop(key, None)
        self._wake()
