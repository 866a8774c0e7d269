"""What the service needs of a configuration, with the command line's word over the file's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fusiond.assembly.controlling import command_deadline_s
from fusiond.config import RESERVED
from fusiond.engine.layout import Layout
from fusiond.errors import ConfigError
from fusiond.service.endpoints import checked_endpoint, checked_key
from fusiond.service.roles import CENTER, outer_prefix
from fusiond.types import Role


@dataclass(frozen=True, slots=True)
class Settings:
    """How one daemon meets the network.

    Args:
        prefix: namespace of every key.      keys: key expression of every sensor, by name.
        role: `alone`, `node` or `center`.      nodes: of a center, the sensors of each.
        deadline_s: time without a command after which the safe one goes out; None without control.
        told: whether to connect also to whom others tell of; in a group every daemon is named.
        rank: in the group, None for a daemon alone.   takeover_ns: how long the active one may be silent.
        sends: of a node, the key on which each of its updating sensors' tracklets go out, by name.
    """

    prefix: str
    mode: str
    listen: tuple[str, ...]
    connect: tuple[str, ...]
    multicast: bool
    told: bool
    publish_hz: float
    packed: bool
    ring: int
    tick_hz: float
    record_hz: float
    keys: dict[str, str]
    role: str
    nodes: dict[str, list[str]]
    sends: dict[str, str]
    deadline_s: float | None
    rank: int | None
    takeover_ns: int


def settings_of(
    config: Any, layout: Layout, listen: Sequence[str], connect: Sequence[str], rank: int | None = None
) -> Settings:
    """Settings of a configuration; endpoints and rank of the command line replace the file's. Raises: ConfigError."""
    service = config.service
    rank = rank_of(service, rank)
    of_group = endpoints_of(service, rank)
    return Settings(
        prefix=checked_key(config.prefix, "namespace"),
        mode=service.mode,
        listen=_endpoints(listen, of_group[0], "listen"),
        connect=_endpoints(connect, of_group[1], "connect"),
        multicast=service.multicast,
        told=not service.group,
        publish_hz=service.publish_hz,
        packed=service.format == "record",
        ring=service.ring,
        tick_hz=service.tick_hz,
        record_hz=config.recording.estimate_hz,
        keys={
            sensor.name: checked_key(config.key_of(sensor.name), f"sensor.{sensor.name}.key")
            for sensor in layout.sensors
        },
        role=service.role,
        nodes=service.nodes if service.role == CENTER else {},
        sends=_sends(config, layout) if service.role == "node" else {},
        deadline_s=command_deadline_s(config.control, service.tick_hz) if config.control else None,
        rank=rank,
        takeover_ns=round(service.takeover_s * 1e9),
    )


def rank_of(service: Any, said: int | None) -> int | None:
    """Rank in the group, None for a daemon alone. Raises: ConfigError."""
    rank: int | None = service.rank if said is None else said
    if rank is None:
        return 0 if service.group else None
    if rank < 0 or (service.group and rank >= len(service.group)):
        raise ConfigError(
            f"service.rank: is {rank} (limit {len(service.group) - 1}, the last of service.group); "
            "count from 0, or add this daemon's endpoint to the group"
        )
    return rank


def endpoints_of(service: Any, rank: int | None) -> tuple[Sequence[str], Sequence[str]]:
    """Where the configuration has a daemon of this rank listen, and connect to.

    Of two daemons of a group only the one of the higher rank number connects (`sessions.session_options` has why).
    """
    if rank is None or not service.group or service.mode == "client":
        return service.listen, service.connect
    return [service.group[rank]], [*service.group[:rank], *service.connect]


def _endpoints(given: Sequence[str], configured: Sequence[str], what: str) -> tuple[str, ...]:
    """Endpoints to listen on or connect to, checked."""
    if given:
        return tuple(checked_endpoint(one, f"--{what}") for one in given)
    return tuple(checked_endpoint(one, f"service.{what}") for one in configured)


def _sends(config: Any, layout: Layout) -> dict[str, str]:
    """Where a node sends: to the keys a daemon alone would listen to."""
    outer = outer_prefix(config)
    updating = [sensor.name for sensor in layout.sensors if sensor.role is Role.UPDATE]
    return {name: f"{outer}/{name}" if name in RESERVED else f"{outer}/sensor/{name}" for name in updating}
