"""What a node knows of the center's estimate: a sensor whose H bends is linearised there, as with a daemon alone.

A node's own estimate may be far off where its sensors see little, or where it was born long after the configured
start: then its H is wrong and the center would be told so with confidence. So a node waits until it has heard the
center, and takes its own estimate only while the center says that it has none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.service.messages import INVALID
from fusiond.service.state_path import StatePath, Vector


@dataclass(frozen=True, slots=True)
class Where:
    """Where to linearise. known: whether that is settled; x: the center's state, None for the node's own."""

    known: bool
    x: Vector | None


class CenterView:
    """The center as a node hears it.

    Args:
        names: of the states, in order.   angles: (states,) which are angles, rad.
        fresh_ns: an estimate further than this from a reading says nothing of it.
    """

    def __init__(self, names: Sequence[str], angles: NDArray[np.bool_], fresh_ns: int) -> None:
        self._names, self._fresh_ns = names, fresh_ns
        self._path = StatePath(angles)
        self._service = ""

    def estimate(self, content: Mapping[str, Any]) -> None:
        """Take an `estimate` of the center, its state by name or as a list."""
        self._service, state = content["health"], content["state"]
        if self._service != INVALID and len(state) == len(self._names):
            x = [state[name] for name in self._names] if isinstance(state, dict) else state
            self._path.note(int(content["t_ns"]), np.array(x, dtype=np.float64))

    def health(self, content: Mapping[str, Any]) -> None:
        """Take a `health` of the center."""
        self._service = content["service"]

    def where(self, t_ns: int) -> Where:
        """Where to linearise a reading of that time."""
        newest_ns = self._path.newest_ns
        if self._service == INVALID:
            return Where(known=True, x=None)
        if newest_ns is None:
            return Where(known=False, x=None)
        return Where(known=True, x=self._path.at(t_ns) if abs(t_ns - newest_ns) <= self._fresh_ns else None)
