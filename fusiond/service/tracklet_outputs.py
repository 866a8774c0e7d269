"""What a node learns, on the keys its sensors would have with a daemon alone, and what it hears of the center."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import zenoh
from numpy.typing import NDArray

from fusiond.service.lease import Lease
from fusiond.service.outlet import declare
from fusiond.service.output_record import OUTPUT_ENCODINGS, decode_output
from fusiond.service.reading_record import ENCODING
from fusiond.service.roles import outer_prefix
from fusiond.service.tracklets import Tracklets

Take = Callable[[Mapping[str, Any]], None]


class TrackletOutputs:
    """The tracklets of one daemon, and what it hears of the center where it needs that.

    Args:
        sends: key of each sensor's tracklets, by name; empty: this is no node, and nothing is sent.
    """

    def __init__(self, session: zenoh.Session, assembly: Any, sends: Mapping[str, str], lease: Lease) -> None:
        layout = assembly.layout
        self._names = {layout.numbers[name]: name for name in sends}
        self._publishers = {
            layout.numbers[name]: declare(session, key, ENCODING, zenoh.Priority.DATA_HIGH, lease)
            for name, key in sends.items()
        }
        self._lease, self._epoch = lease, lease.epoch
        self._tracklets = Tracklets(assembly.resolved, layout, lease.epoch) if sends else None
        self._heard: list[tuple[Any, Take]] = []
        if self._tracklets is not None and self._tracklets.bent:
            outer, view = outer_prefix(assembly.config), self._tracklets.center
            self._heard = [
                (session.declare_subscriber(f"{outer}/{topic}", zenoh.handlers.RingChannel(1)), take)
                for topic, take in (("health", view.health), ("estimate", view.estimate))
            ]

    @property
    def withheld(self) -> dict[str, int]:
        """Readings of each sensor that were not sent, since the center had not been heard yet."""
        counts = self._tracklets.withheld if self._tracklets is not None else {}
        return {self._names[number]: count for number, count in counts.items()}

    def publish(self, readings: NDArray[Any], reports: NDArray[Any]) -> None:
        """Send what these readings taught."""
        if self._tracklets is None:
            return
        if self._epoch != self._lease.epoch:
            self._epoch = self._lease.epoch
            self._tracklets.begin(self._epoch)
        for subscriber, take in self._heard:
            sample = subscriber.try_recv()
            if sample is not None:
                # What cannot be read is as good as not heard.
                with suppress(ValueError, TypeError, KeyError, RecursionError):
                    take(content_of(sample))
        for number, encoding, payload in self._tracklets.puts(readings, reports):
            self._publishers[number].put(payload, encoding=encoding)


def content_of(sample: zenoh.Sample) -> Mapping[str, Any]:
    """A message of a daemon. Raises: ValueError, RecursionError where it is none."""
    payload = sample.payload.to_bytes()
    if str(sample.encoding) in OUTPUT_ENCODINGS:
        return decode_output(payload)
    found: Mapping[str, Any] = json.loads(payload)
    return found
