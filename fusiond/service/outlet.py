"""How the daemon publishes. Everything goes out with DROP: a consumer that does not read must never make it wait."""

from __future__ import annotations

from typing import Any

import zenoh

from fusiond.service.lease import Lease

JSON = "application/json"


class Outlet:
    """One publisher, silent while its daemon may not speak."""

    def __init__(self, publisher: zenoh.Publisher, lease: Lease) -> None:
        self._publisher, self._lease = publisher, lease

    def put(self, payload: bytes, **others: Any) -> None:
        """Send, if this daemon may speak."""
        if self._lease.valid:
            self._publisher.put(payload, **others)

    @property
    def is_heard(self) -> bool:
        """Whether this daemon may speak and anybody listens."""
        status: Any = self._publisher.matching_status  # the stub of 1.10 calls it a bool
        return self._lease.valid and bool(status.matching)


def declare(
    session: zenoh.Session, key: str, encoding: str, priority: zenoh.Priority, lease: Lease
) -> Outlet:
    """A publisher; one priority for each key, since Zenoh reorders across priorities."""
    publisher = session.declare_publisher(
        key, encoding=encoding, priority=priority, congestion_control=zenoh.CongestionControl.DROP
    )
    return Outlet(publisher, lease)
