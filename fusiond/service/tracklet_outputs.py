"""What a node's filter learns, on the keys its sensors would have with a daemon alone."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import zenoh
from numpy.typing import NDArray

from fusiond.service.outlet import declare
from fusiond.service.reading_record import ENCODING
from fusiond.service.tracklets import Tracklets


class TrackletOutputs:
    """The tracklets of one daemon.

    Args:
        publishers: of each updating sensor, by number.      tracklets: makes them; None: this is no node.
    """

    def __init__(self, publishers: Mapping[int, zenoh.Publisher], tracklets: Tracklets | None) -> None:
        self._publishers, self._tracklets = publishers, tracklets

    def publish(self, readings: NDArray[Any], reports: NDArray[Any]) -> None:
        """Send what these readings taught."""
        if self._tracklets is not None:
            for number, encoding, payload in self._tracklets.puts(readings, reports):
                self._publishers[number].put(payload, encoding=encoding)


def tracklet_outputs(
    session: zenoh.Session, assembly: Any, sends: Mapping[str, str], epoch: int
) -> TrackletOutputs:
    """Those of a daemon.

    Args:
        sends: key of each sensor's tracklets, by name; empty: this is no node, and nothing is sent.
    """
    if not sends:
        return TrackletOutputs({}, None)
    layout = assembly.layout
    publishers = {
        layout.numbers[name]: declare(session, key, ENCODING, zenoh.Priority.DATA_HIGH)
        for name, key in sends.items()
    }
    return TrackletOutputs(publishers, Tracklets(assembly.resolved, layout, epoch))
