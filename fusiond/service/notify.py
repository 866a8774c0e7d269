"""Telling systemd: READY=1, WATCHDOG=1 while the loop goes round, STOPPING=1, over NOTIFY_SOCKET. Silent without it."""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping


class Notifier:
    """The service manager's ear.

    Args:
        environment: where NOTIFY_SOCKET and WATCHDOG_USEC stand.
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        address = environment.get("NOTIFY_SOCKET", "")
        self._address = "\0" + address[1:] if address.startswith("@") else address
        usec = environment.get("WATCHDOG_USEC", "")
        mine = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        self.feed_every_ns = int(usec) * 1000 // 4 if self._address and usec.isdigit() and mine else 0
        self._fed_ns = 0

    def ready(self) -> None:
        """Readings are taken from now on."""
        self._send("READY=1")

    def stopping(self) -> None:
        """The end has begun."""
        self._send("STOPPING=1")

    def went_round(self, now_ns: int) -> None:
        """Called by the loop every time it goes round; feeds the watchdog four times per its limit."""
        if self.feed_every_ns and now_ns - self._fed_ns >= self.feed_every_ns:
            self._fed_ns = now_ns
            self._send("WATCHDOG=1")

    def _send(self, text: str) -> None:
        if not self._address:
            return
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as ear:
                ear.sendto(text.encode(), self._address)
        except OSError:
            # A manager that does not listen must not end the daemon; its own watchdog then decides.
            return
