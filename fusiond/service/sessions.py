"""Zenoh sessions: how the daemon is reached, and how its parts are kept from holding each other up.

As a peer or router the daemon listens, and its one endpoint serves all: the listening session takes the sensors'
readings and gives out the estimate without another hop, and relays between its clients. Queries are answered by a
session of their own, a client over a private socket, so that a slow answer can never hold up a link with readings.
As a client of somebody's router, sensors, control and administration are three sessions with a link each.
"""

from __future__ import annotations

import json
import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import zenoh

from fusiond.errors import ConnectionFailed
from fusiond.service.endpoints import checked_endpoint

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
LEASE_MS = 1000
"""A peer that has stopped is noticed after this long; every side announces its own. `election.SETTLE_NS` is as long."""
RETRY_MS = 250
"""Longest pause between two tries to connect: well within the time that a daemon looks for others of its group."""
RETRY_S = 0.1
POLL_S = 0.01
OPEN_TIMEOUT_S = 10.0
CONNECT_S = 5.0
"""The same for who asks or publishes."""

Options = dict[str, Any]
Endpoints = str | Sequence[str]


def session_options(
    mode: str,
    listen: Sequence[str] = (),
    connect: Sequence[str] = (),
    *,
    multicast: bool = False,
    told: bool = True,
) -> Options:
    """The settings every session of fusiond shares. Shared memory is off: records are far too small for it.

    Args:
        told: whether a peer connects to those that others tell of, beside those named.
    Of two ends that listen only one connects: where both do, Zenoh 1.10 may take the new link of one for another of a
    transport that is cut, and from then on give out what comes over it under wrong keys.
    """
    strategy = "greater-zid" if listen else "always"
    return {
        "mode": mode,
        "listen/endpoints": list(listen),
        "connect/endpoints": list(connect),
        "scouting/multicast/enabled": multicast,
        "scouting/gossip/enabled": True,
        "scouting/gossip/autoconnect": {
            "router": [],
            "peer": ["router", "peer"] if told else [],
            "client": [],
        },
        "scouting/gossip/autoconnect_strategy": {"peer": {"to_router": "always", "to_peer": strategy}},
        "scouting/multicast/autoconnect_strategy": {"peer": {"to_router": "always", "to_peer": strategy}},
        "scouting/delay": 500 if multicast else 0,
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": LEASE_MS,
        "transport/link/tx/keep_alive": 4,
        "connect/timeout_ms": 0 if mode == "client" else -1,
        "connect/exit_on_failure": mode == "client",
        "connect/retry": {"period_init_ms": 100, "period_max_ms": RETRY_MS},
    }


def open_session(
    options: Options, *, timeout_s: float = OPEN_TIMEOUT_S, give_up: Callable[[], bool] = lambda: False
) -> zenoh.Session:
    """Open a session, trying again until `timeout_s` has passed: Zenoh's own waiting cannot be interrupted.

    Args:
        give_up: asked between tries; a pending stop ends the waiting.
    Raises: ConnectionFailed where nobody answers in time, or an endpoint to listen on is taken or impossible.
    """
    zenoh.init_log_from_env_or("off")
    deadline = time.monotonic() + timeout_s
    while True:
        try:
            return zenoh.open(_config(options))
        except zenoh.ZError as error:
            reason = str(error)
        if options["listen/endpoints"] and "listener" in reason:
            raise ConnectionFailed(_listen_failure(options, reason))
        if give_up() or time.monotonic() > deadline:
            if not options["connect/endpoints"]:
                raise ConnectionFailed(_listen_failure(options, reason))
            where = ", ".join(options["connect/endpoints"]) or "no endpoint"
            raise ConnectionFailed(
                f"connect {where}: nobody answered within {timeout_s:g} s; start the daemon (`fusiond run`) or router "
                f"there, or name the endpoint of its `ready` line with --connect"
            )
        time.sleep(RETRY_S)


def join(connect: Endpoints, *, timeout_s: float = CONNECT_S) -> zenoh.Session:
    """A session of a sensor or consumer.

    Args:
        connect: endpoint of the daemon or router; several: of all daemons of a group, each of which is told and heard
            directly, so that nothing is missed when one of them goes.
    Raises: ConfigError where one is no endpoint; ConnectionFailed where nobody answers in time.
    """
    given = [connect] if isinstance(connect, str) else list(connect)
    endpoints = [checked_endpoint(endpoint, "connect") for endpoint in given]
    if len(endpoints) == 1:
        return open_session(session_options("client", connect=endpoints), timeout_s=timeout_s)
    session = open_session(session_options("peer", connect=endpoints), timeout_s=timeout_s)
    deadline = time.monotonic() + timeout_s
    while not (session.info.peers_zid() or session.info.routers_zid()):
        if time.monotonic() > deadline:
            session.close()
            raise ConnectionFailed(
                f"connect {', '.join(endpoints)}: nobody answered within {timeout_s:g} s; start a daemon there"
            )
        time.sleep(POLL_S)
    return session


def _config(options: Options) -> zenoh.Config:
    config = zenoh.Config()
    for key, value in options.items():
        try:
            config.insert_json5(key, json.dumps(value))
        except zenoh.ZError as error:
            raise ConnectionFailed(
                f"{key}: {value!r} is not accepted ({_short(str(error))}); correct it"
            ) from error
    return config


def _listen_failure(options: Options, reason: str) -> str:
    where = ", ".join(one for one in options["listen/endpoints"] if not one.startswith("unixsock-stream/"))
    if "in use" in reason:
        return (
            f"listen {where}: the address is in use; stop the other daemon, choose --listen tcp/127.0.0.1:0, or join "
            f"it with --connect and a --listen of your own"
        )
    return f"listen {where}: {_short(reason)}; choose another --listen, e.g. {DEFAULT_ENDPOINT}"


def _short(reason: str) -> str:
    """Zenoh's text without the places in its own source."""
    return reason.split(" at /", maxsplit=1)[0].strip(" !.")


@dataclass(slots=True)
class Sessions:
    """The daemon's sessions; `sensors` and `control` are one where it listens itself.

    Args:
        endpoints: where clients reach the daemon, as printed in the `ready` line.
    """

    sensors: zenoh.Session
    control: zenoh.Session
    admin: zenoh.Session
    endpoints: tuple[str, ...]
    private: Path | None = field(default=None)

    def close(self) -> None:
        """Close them all, the asking side first; what waits in a `recv` ends with an error."""
        for session in (self.admin, self.control, self.sensors):
            if not session.is_closed():
                session.close()
        if self.private is not None:
            shutil.rmtree(self.private, ignore_errors=True)


def open_sessions(
    mode: str,
    listen: Sequence[str],
    connect: Sequence[str],
    *,
    multicast: bool = False,
    told: bool = True,
    give_up: Callable[[], bool] = lambda: False,
) -> Sessions:
    """Open what the daemon needs, as `session_options` has it. Raises: ConnectionFailed."""
    if mode == "client":
        return _open_client(connect, give_up)
    private = Path(tempfile.mkdtemp(prefix="fusiond-"))
    inner = f"unixsock-stream/{private}/admin.sock"
    opened: list[zenoh.Session] = []
    try:
        options = session_options(mode, [*listen, inner], connect, multicast=multicast, told=told) | {
            "adminspace/enabled": True,
            "adminspace/permissions/read": True,
            "adminspace/permissions/write": False,
        }
        hub = open_session(options, give_up=give_up)
        opened.append(hub)
        admin = open_session(session_options("client", connect=[inner]), give_up=give_up)
        opened.append(admin)
        return Sessions(hub, hub, admin, public_endpoints(hub, mode), private)
    except BaseException:
        for session in opened:
            session.close()
        shutil.rmtree(private, ignore_errors=True)
        raise


def _open_client(connect: Sequence[str], give_up: Callable[[], bool]) -> Sessions:
    opened: list[zenoh.Session] = []
    try:
        for _ in range(3):
            opened.append(open_session(session_options("client", connect=connect), give_up=give_up))
    except BaseException:
        for session in opened:
            session.close()
        raise
    return Sessions(opened[0], opened[1], opened[2], tuple(connect))


def public_endpoints(hub: zenoh.Session, mode: str) -> tuple[str, ...]:
    """Where the listening session is reached, port 0 resolved: read from its own admin space.

    Raises: ConnectionFailed where it does not know, which is a defect of the Zenoh in use.
    """
    for reply in hub.get(f"@/{hub.zid()}/{mode}", timeout=2.0):
        if reply.ok is not None:
            found = json.loads(reply.ok.payload.to_string())["locators"]
            return tuple(str(one) for one in found if not one.startswith("unixsock-stream/"))
    raise ConnectionFailed("listen: the session cannot tell its own endpoint; name a port instead of 0")
