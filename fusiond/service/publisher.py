"""A sensor: its readings, numbered and stamped, to a daemon."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence, Sized
from contextlib import suppress
from types import TracebackType
from typing import Any, Literal, Self

import zenoh

from fusiond.errors import ConnectionFailed
from fusiond.service import reading_json, reading_record
from fusiond.service.endpoints import checked_key
from fusiond.service.sessions import CONNECT_S, DEFAULT_ENDPOINT, Endpoints, join

Covariance = Sequence[float] | Sequence[Sequence[float]]
ENCODINGS = ("json", "record")
SETTLE_S = 2.0
RESERVED = ("reference", "applied")


def settle(session: zenoh.Session, key: str) -> None:
    """Wait until what was put has left: a question nobody answers queues behind it, and its end comes back."""
    with suppress(zenoh.ZError):
        for _ in session.get(key, timeout=SETTLE_S):
            pass


class SensorPublisher:
    """Publishes the readings of one sensor. Numbers them from 0; stamps those that bring no time.

    Args:
        name: the configuration's.      sensor: the sensor's name in it, also `reference` or `applied`.
        connect: endpoint of the daemon or router, or those of all daemons of a group.
        encoding: `json` for people, `record` for speed (packed, with a checksum).
        pack: readings sent in one put; more than one trades delay for throughput (`flush` sends what waits).
        key: key expression, where the configuration gives the sensor its own.
        lossless: make `publish` wait where the network is slower than the sensor. For playing recordings, not for
            live sensors: a reading that comes late is worth less than the next one.
        session: an open session to share; it is left open.
    Raises: ConfigError where `connect` is no endpoint or the key none; ConnectionFailed where nobody answers in time.
    """

    def __init__(
        self, name: str, sensor: str, connect: Endpoints = DEFAULT_ENDPOINT, *, namespace: str | None = None,
        encoding: Literal["json", "record"] = "json", pack: int = 1, key: str | None = None, lossless: bool = False,
        session: zenoh.Session | None = None,
    ) -> None:  # fmt: skip
        prefix = namespace or f"fusiond/{name}"
        standing = f"{prefix}/{sensor}" if sensor in RESERVED else f"{prefix}/sensor/{sensor}"
        self.key = checked_key(key or standing, f"{name}: {sensor}", single=True)
        if encoding not in ENCODINGS or pack < 1:
            known = " or ".join(ENCODINGS)
            raise ValueError(
                f"{self.key}: encoding {encoding!r}, pack {pack!r}; choose {known}, and 1 or more"
            )
        self.seq = 0
        self._packs_records = encoding == "record"
        self._pack = pack
        self._waiting: list[bytes | str] = []
        self._own = session is None
        self.session = session or join(connect)
        control = zenoh.CongestionControl.BLOCK if lossless else zenoh.CongestionControl.DROP
        self._publisher = self.session.declare_publisher(
            self.key, congestion_control=control,
            encoding=reading_record.ENCODING if self._packs_records else reading_json.ENCODING,
        )  # fmt: skip

    def publish(
        self, z: Sequence[float] | float, t_ns: int | None = None, R: Covariance | None = None
    ) -> None:
        """Send one reading.

        Args:
            z: its numbers in the order and units of the configuration's channels; one number may stand alone.
            t_ns: when it was measured, ns; without it, now (ns since 1970).
            R: its covariance (rows; JSON only) or variances, in squared units of z.
        Raises: ValueError where z is empty or R does not fit.
        """
        stamp = time.time_ns() if t_ns is None else int(t_ns)
        values = z if isinstance(z, Sized) else (float(z),)
        if not len(values) or (R is not None and len(R) != len(values)):
            raise ValueError(
                f"{self.key}: {len(values)} numbers with R = {R}; give one or more, and R as many rows"
            )
        self._waiting.append(self._encode(values, stamp, R))
        self.seq += 1
        if len(self._waiting) >= self._pack:
            self.flush()

    def flush(self) -> None:
        """Send what waits to be packed."""
        waiting, self._waiting = self._waiting, []
        if not waiting:
            return
        if self._packs_records:
            self._publisher.put(b"".join(one for one in waiting if isinstance(one, bytes)))
        elif len(waiting) == 1:
            self._publisher.put(waiting[0])
        else:
            self._publisher.put(f"[{', '.join(str(one) for one in waiting)}]")

    def wait_until_heard(self, timeout_s: float = CONNECT_S) -> None:
        """Wait until somebody listens: what is sent before is lost.

        Raises: ConnectionFailed where nobody does in time.
        """
        heard = threading.Event()

        def note(status: Any) -> None:
            if status.matching:
                heard.set()

        listener = self._publisher.declare_matching_listener(zenoh.handlers.Callback(note, indirect=False))
        status: Any = self._publisher.matching_status  # the stub of 1.10 calls it a bool
        found = status.matching or heard.wait(timeout_s)
        listener.undeclare()
        if not found:
            raise ConnectionFailed(
                f"{self.key}: nobody listened within {timeout_s:g} s; compare it with the keys of the configuration"
            )

    def close(self) -> None:
        """Send what waits and leave."""
        if not self.session.is_closed():
            self.flush()
            self._publisher.undeclare()
            if self._own:
                settle(self.session, self.key)
                self.session.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _encode(self, z: Sequence[float], t_ns: int, R: Any) -> bytes | str:
        if not self._packs_records:
            return reading_json.encode_json(z, t_ns, self.seq, R)
        if R is not None and len(R) and not isinstance(R[0], (int, float)):
            raise ValueError(f"{self.key}: a record carries variances, not rows; send this R as JSON")
        return reading_record.encode_record(z, t_ns, self.seq, R)
