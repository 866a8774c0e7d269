"""Errors taken off readings: one put on top of another, and whether that has made the innovations better.

A reading is used as z' = (z - offset - drift t) / (1 + gain_error), measured `lag` before its stamp. An error found in
z' is one of the corrected reading, so with what is taken off already it makes

    bias b: offset + (1 + gain_error) b,   drift likewise,   scale s: (1 + gain_error) (1 + s) - 1,   delay: the sum.

No step is believed for itself. A fit promises that the squares of the innovations since its onset will be fewer; the
readings are replayed with it, and where there are not fewer it is withdrawn: what was wrong was not that.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fusiond.faults.window import believed
from fusiond.types import Kind

if TYPE_CHECKING:
    from fusiond.engine.engine import Engine

CORRECTIONS = {Kind.BIAS: "offset", Kind.DRIFT: "drift", Kind.SCALE: "gain_error", Kind.DELAY: "lag"}
"""Field of what is taken off, by the kind of the error."""
LASTING = tuple(CORRECTIONS)
"""Errors that can be taken off a reading."""


def put_on(taken: dict[str, Any], kind: Kind, channel: int, size: float) -> None:
    """Add an error found in corrected readings to what is taken off a raw channel.

    Args:
        taken: `offset`, `drift`, `gain_error`, `lag`, (m,) each; changed.   size: as in `Hypothesis`.
    Law: tests/laws/test_correction.py::test_a_second_error_is_taken_off_what_is_left_of_the_first.
    """
    gain = 1.0 + float(taken["gain_error"][channel])
    share = gain if kind in (Kind.BIAS, Kind.DRIFT, Kind.SCALE) else 1.0
    taken[CORRECTIONS[kind]][channel] += share * size


def once_gone(
    window: NDArray[Any], reaction: Any, sensor: int, drives: Sequence[int] = ()
) -> NDArray[np.float64]:
    """(W, m) error of a sensor's corrected readings, raw channels, in each entry if what is taken off had gone by then.

    Args:
        reaction: one record.   drives: process input of each channel, of a sensor that drives: then (W, k) of inputs.
    """
    since_s = ((window["t_ns"] - reaction["from_ns"][sensor, 1]) * 1e-9)[:, None]
    offset, drift, gain_error, lag = (reaction[field][sensor, 1] for field in CORRECTIONS.values())
    m = window["h"].shape[1]
    h, hdot = (np.zeros((len(window), len(offset))) for _ in range(2))
    if not len(drives):
        h[:, :m], hdot[:, :m] = window["h"], window["hdot"]
    left = (h - offset - drift * since_s) / (1.0 + gain_error) - h + hdot * lag
    left = np.where(since_s >= 0.0, left, 0.0)
    if not len(drives):
        return np.asarray(left[:, :m])
    of_inputs = np.zeros((len(window), window["B"].shape[2]))
    of_inputs[:, list(drives)] = left[:, : len(drives)]
    return of_inputs


def misfit(engine: Engine, since_ns: int) -> float:
    """Sum of the squares of the window's innovations since a time; infinite where they are no numbers."""
    window, _ = believed(engine.window)
    late = window["t_ns"] >= since_ns
    exists = np.arange(window["e"].shape[1]) < window["dof"][late, None]
    total = float(np.sum(np.where(exists, window["e"][late], 0.0) ** 2))
    return total if np.isfinite(total) else np.inf


class Attempt:
    """A correction on trial: what was decided about some sensors before it, and how well that fitted.

    Args:
        sensors: that it is about.   since_ns: onset of the error.
    """

    def __init__(self, engine: Engine, sensors: tuple[int, ...], since_ns: int) -> None:
        self._engine, self._since_ns = engine, since_ns
        reaction = engine.track[0]["reaction"]
        self._was: list[tuple[int, str, NDArray[Any]]] = [
            (sensor, field, np.array(reaction[field][sensor]))
            for sensor in sensors
            for field in reaction.dtype.names
            if reaction.dtype[field].shape
        ]
        self._misfit = misfit(engine, since_ns)

    @property
    def helped(self) -> bool:
        """Whether, replayed, the innovations since the onset have become smaller."""
        return misfit(self._engine, self._since_ns) < self._misfit

    def withdraw(self) -> None:
        """Decide as before about these sensors, and replay."""
        for records in self._engine.histories:
            for sensor, field, value in self._was:
                records["reaction"][field][:, sensor] = value
        self._engine.replay_since(self._since_ns)
