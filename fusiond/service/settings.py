"""What the service needs of a configuration, with the command line's word over the file's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import zenoh

from fusiond.engine.layout import Layout
from fusiond.errors import ConfigError
from fusiond.types import Role

RESERVED = {Role.REFERENCE: "reference", Role.APPLIED: "applied"}
"""Roles whose sensors stand directly under the namespace."""


@dataclass(frozen=True, slots=True)
class Settings:
    """How one daemon meets the network.

    Args:
        prefix: namespace of every key.      keys: key expression of every sensor, by name.
        silence_s: longest healthy silence of every sensor that has one, by name; for messages.
    """

    prefix: str
    mode: str
    listen: tuple[str, ...]
    connect: tuple[str, ...]
    multicast: bool
    publish_hz: float
    packed: bool
    ring: int
    tick_hz: float
    record_hz: float
    keys: dict[str, str]
    silence_s: dict[str, float]


def settings_of(config: Any, layout: Layout, listen: Sequence[str], connect: Sequence[str]) -> Settings:
    """Settings of a configuration; endpoints of the command line replace the file's."""
    service = config.service
    return Settings(
        prefix=config.prefix,
        mode=service.mode,
        listen=tuple(listen) or tuple(service.listen),
        connect=tuple(connect) or tuple(service.connect),
        multicast=service.multicast,
        publish_hz=service.publish_hz,
        packed=service.format == "record",
        ring=service.ring,
        tick_hz=service.tick_hz,
        record_hz=config.recording.estimate_hz,
        keys={sensor.name: key_of(config, sensor.name, sensor.role) for sensor in layout.sensors},
        silence_s=silences(config),
    )


def key_of(config: Any, name: str, role: Role) -> str:
    """Key expression a sensor publishes on. Raises: ConfigError where Zenoh has none of that form."""
    section = config.sensor.get(name)
    if section is not None and section.key:
        return checked(str(section.key), f"sensor.{name}.key")
    own = RESERVED.get(role, f"sensor/{name}")
    return checked(f"{config.prefix}/{own}", "namespace")


def checked(key: str, subject: str) -> str:
    """A key expression in its canonical form. Raises: ConfigError."""
    try:
        return str(zenoh.KeyExpr.autocanonize(key))
    except zenoh.ZError as error:
        raise ConfigError(
            f"{subject}: `{key}` is no key expression; write chunks between single slashes, none at either end, "
            "with * or ** only as whole chunks"
        ) from error


def silences(config: Any) -> dict[str, float]:
    """Longest healthy silence by sensor: as configured, or three periods of its rate."""
    found: dict[str, float] = {}
    for name, section in config.sensor.items():
        if section.max_silence_s is not None:
            found[name] = section.max_silence_s
        elif section.rate_hz is not None:
            found[name] = 3.0 / section.rate_hz
    return found
