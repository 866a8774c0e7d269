"""Plays readings of a recording to a daemon, as their sensors would have sent them."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.engine.records import HAS_ARRIVAL, HAS_R, HAS_SEQ
from fusiond.service.publisher import SensorPublisher, settle
from fusiond.service.sessions import CONNECT_S, DEFAULT_ENDPOINT, Endpoints, join
from fusiond.types import Role

RESERVED = (Role.REFERENCE, Role.APPLIED)


class Player:
    """Publishes reading arrays in their order, each at its time, with the stamps they have.

    Args:
        name: the configuration's.      layout: names the sensors of the arrays.
        connect: endpoint of the daemon or router, or those of all daemons of a group.
        speed: 1 is real time, 2 twice as fast; infinite: as fast as `most_hz` allows.
        most_hz: highest rate of puts, whatever the speed: what a daemon can take without loss depends on it.
        encoding: of the readings; their own covariances that are not diagonal go as JSON in any case.
        keys: key expressions of sensors that have their own, by name.
    Raises: ConnectionFailed where nobody answers in `CONNECT_S`.
    """

    def __init__(
        self, name: str, layout: Layout, connect: Endpoints = DEFAULT_ENDPOINT, *, namespace: str | None = None,
        speed: float = 1.0, most_hz: float = 5000.0, encoding: Literal["json", "record"] = "record",
        keys: dict[str, str] | None = None,
    ) -> None:  # fmt: skip
        self._speed = speed
        self._period_s = 1.0 / most_hz
        self._session = join(connect)
        self.publishers = [
            SensorPublisher(
                name, sensor.name, connect, namespace=namespace, encoding=encoding, lossless=True,
                key=(keys or {}).get(sensor.name), session=self._session,
            )
            for sensor in layout.sensors
        ]  # fmt: skip
        self._rows = encoding == "json"
        self._began_s: float | None = None
        self._first_ns = 0
        self._sent_s = 0.0

    def wait_until_heard(self, timeout_s: float = CONNECT_S) -> None:
        """Wait until the daemon listens to every sensor. Raises: ConnectionFailed."""
        for publisher in self.publishers:
            publisher.wait_until_heard(timeout_s)

    def play(self, readings: NDArray[Any]) -> None:
        """Publish one block; the next block goes on in the same time. Ticks are left out."""
        for reading in readings:
            if int(reading["sensor"]) >= 0:
                self._wait_for(self._time_ns(reading))
                self._publish(reading)

    def close(self) -> None:
        """Leave."""
        for publisher in self.publishers:
            publisher.close()
        settle(self._session, self.publishers[0].key)
        self._session.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _publish(self, reading: Any) -> None:
        publisher = self.publishers[int(reading["sensor"])]
        n = min(int(reading["length"]), len(reading["z"]))
        R: Any = None
        if int(reading["flags"]) & HAS_R:
            rows = reading["R"][:n, :n]
            R = rows.tolist() if self._rows else np.diag(rows).tolist()
        if int(reading["flags"]) & HAS_SEQ:
            publisher.seq = int(reading["seq"])
        publisher.publish(reading["z"][:n].tolist(), int(reading["t_ns"]), R)

    def _time_ns(self, reading: Any) -> int:
        arrived = int(reading["flags"]) & HAS_ARRIVAL
        return int(reading["arrival_ns"] if arrived else reading["t_ns"])

    def _wait_for(self, time_ns: int) -> None:
        """Sleep until it is this reading's turn; one that lies back in time goes at once."""
        now_s = time.monotonic()
        if self._began_s is None:
            self._began_s, self._first_ns = now_s, time_ns
        turn_s = self._began_s + (time_ns - self._first_ns) / 1e9 / self._speed
        turn_s = max(turn_s, self._sent_s + self._period_s)
        if turn_s > now_s:
            time.sleep(turn_s - now_s)
        self._sent_s = max(turn_s, now_s)
