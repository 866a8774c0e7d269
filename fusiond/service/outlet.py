"""How the daemon publishes. Everything goes out with DROP: a consumer that does not read must never make it wait."""

from __future__ import annotations

from typing import Any

import zenoh

JSON = "application/json"


def declare(session: zenoh.Session, key: str, encoding: str, priority: zenoh.Priority) -> zenoh.Publisher:
    """A publisher; one priority for each key, since Zenoh reorders across priorities."""
    return session.declare_publisher(
        key, encoding=encoding, priority=priority, congestion_control=zenoh.CongestionControl.DROP
    )


def is_heard(publisher: zenoh.Publisher) -> bool:
    """Whether anybody listens to a publisher now."""
    status: Any = publisher.matching_status  # the stub of 1.10 calls it a bool
    return bool(status.matching)
