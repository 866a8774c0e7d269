"""Endpoints and keys as Zenoh spells them, checked before anything is opened: Zenoh would try a wrong one for ever."""

from __future__ import annotations

import re

import zenoh

from fusiond.errors import ConfigError

HOST_AND_PORT = frozenset({"tcp", "udp", "tls", "quic", "ws"})
OTHERS = frozenset({"unixsock-stream", "unixpipe", "serial", "vsock"})
HIGHEST_PORT = 65535
FORM = re.compile(r"(?P<protocol>[a-z-]+)/(?P<address>[^?#]+)(?:\?[^#]*)?(?:#.*)?")
ADDRESS = re.compile(r"(?P<host>\[[0-9A-Fa-f:.%\w]+\]|[^:\[\]/\s]+):(?P<port>[^:]*)")


def checked_endpoint(endpoint: str, subject: str) -> str:
    """The endpoint, as it is.

    Args:
        subject: who said it, e.g. `--listen`.
    Raises: ConfigError where it is none: no protocol, no host, a port that is not one.
    """
    protocols = ", ".join(sorted(HOST_AND_PORT | OTHERS))
    form = FORM.fullmatch(endpoint)
    if form is None:
        raise ConfigError(
            f"{subject}: `{endpoint}` is no endpoint (PROTOCOL/ADDRESS); write e.g. tcp/127.0.0.1:7447"
        )
    protocol, address = form["protocol"], form["address"]
    if protocol not in HOST_AND_PORT | OTHERS:
        raise ConfigError(f"{subject}: `{endpoint}` has an unknown protocol; write one of {protocols}")
    if protocol in HOST_AND_PORT:
        parts = ADDRESS.fullmatch(address)
        if parts is None:
            raise ConfigError(
                f"{subject}: `{endpoint}` has no HOST:PORT; write e.g. {protocol}/127.0.0.1:7447"
            )
        port = parts["port"]
        if not (port.isascii() and port.isdigit() and int(port) <= HIGHEST_PORT):
            raise ConfigError(
                f"{subject}: `{endpoint}` has the port `{port}` (limit {HIGHEST_PORT}); write a number from 1 to it, "
                "or 0 to have a free one picked"
            )
    return endpoint


def checked_key(key: str, subject: str, *, single: bool = False) -> str:
    """A key expression in its canonical form.

    Args:
        subject: who said it.      single: whether it must be one key, as for who publishes.
    Raises: ConfigError.
    """
    try:
        found = str(zenoh.KeyExpr.autocanonize(key))
    except zenoh.ZError as error:
        raise ConfigError(
            f"{subject}: `{key}` is no key expression; write chunks between single slashes, none at either end, "
            "with * or ** only as whole chunks"
        ) from error
    if single and "*" in found:
        raise ConfigError(f"{subject}: `{found}` is many keys; name the one to publish on")
    return found
