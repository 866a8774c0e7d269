"""Faults on a recording: a log whose sensors lie, for a replay that does not know.

    lies = Injected(open_log(path, layout), measured_of(assembly), parse_faults(["gps.bias=20@10"]), seed=0)
    replay(assembly.engine(), lies)

Streaming: a chunk is altered as it passes, and copied first where it is. What no fault meets keeps its bits.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.assembly import Assembly
from fusiond.engine.records import HAS_R
from fusiond.simulation.faults import Fault, parse_faults
from fusiond.simulation.faults_injection import Injection, Measured, SensorFaults

__all__ = ["Injected", "inject_into", "measured_of"]


def measured_of(assembly: Assembly) -> tuple[Measured, ...]:
    """What a configuration says of its sensors' readings: how many numbers, their noise, which are angles."""
    found = []
    for sensor in assembly.resolved.sensors:
        channels, dof = sensor.model.channels, sensor.model.dof
        sigma = np.sqrt(np.diag(sensor.R)[:dof]).tolist()
        angles = frozenset(k for k, slot in enumerate(channels) if slot.name in sensor.model.wraps)
        names = tuple(slot.key for slot in channels)
        found.append(Measured(sensor.name, len(channels), dof, tuple(sigma), angles, names))
    return tuple(found)


def inject_into(
    chunks: Iterable[NDArray[Any]], assembly: Assembly, specifications: Sequence[str], seed: int
) -> Injected:
    """A log with the faults an operator specified. Raises: ConfigError where one is none, or fits no sensor."""
    return Injected(chunks, measured_of(assembly), parse_faults(specifications), seed)


class Injected:
    """Arrays of readings in order of arrival, lies included; may be iterated again, to the same bits.

    Args:
        chunks: of `layout.reading`; events (ticks, resets) pass.      sensors: in the order of their numbers.
    Raises: ConfigError where a fault fits no sensor.
    """

    def __init__(
        self, chunks: Iterable[NDArray[Any]], sensors: Sequence[Measured], faults: Sequence[Fault], seed: int
    ) -> None:
        self._chunks, self._sensors = chunks, sensors
        self.faults, self.seed = tuple(faults), seed
        self._running = self._injection()

    @property
    def note(self) -> str:
        """A line of comment for the configuration of a recording that holds these readings."""
        return f"# injected into these readings, seed {self.seed}: {' '.join(map(str, self.faults))}\n"

    @property
    def warnings(self) -> list[str]:
        """Faults that met no reading when last iterated."""
        return [
            f"inject {fault}: met no reading; compare it with the times of the log"
            for fault in self._running.unmet()
        ]

    def __iter__(self) -> Iterator[NDArray[Any]]:
        injection = self._running = self._injection()
        lying = [
            (number, sensor, faults)
            for number, sensor in enumerate(self._sensors)
            if (faults := injection.of(sensor.name)) is not None
        ]
        for chunk in self._chunks:
            readings = np.flatnonzero(chunk["sensor"] >= 0)
            if readings.size:
                injection.start(int(chunk["t_ns"][readings[0]]))
            sent = chunk
            keep = np.ones(len(chunk), np.bool_)
            for number, sensor, faults in lying:
                rows = np.flatnonzero(chunk["sensor"] == number)
                if rows.size:
                    sent = _lied(sent, sent is chunk, rows, sensor.channels or 0, faults, keep)
            sent = sent if keep.all() else sent[keep]
            if len(sent):
                yield sent

    def _injection(self) -> Injection:
        return Injection(self.faults, self._sensors, self.seed)


def _lied(
    chunk: NDArray[Any], shared: bool, rows: NDArray[np.intp], channels: int, faults: SensorFaults,
    keep: NDArray[np.bool_],
) -> NDArray[Any]:  # fmt: skip
    """The chunk with one sensor's readings as it sends them; a copy where it is shared and they differ."""
    z = chunk["z"][rows, :channels]
    lies, sent = faults.apply(chunk["t_ns"][rows], z, _own_deviations(chunk, rows, channels, faults.sensor))
    keep[rows] = sent
    short = np.arange(channels) >= chunk["length"][rows, np.newaxis]
    if short.any():
        # A reading with too few numbers has no more of them than before.
        lies = np.where(short, z, lies)
    if lies is z:
        return chunk
    out = chunk.copy() if shared else chunk
    out["z"][rows, :channels] = lies
    return out


def _own_deviations(
    chunk: NDArray[Any], rows: NDArray[np.intp], channels: int, sensor: Measured
) -> NDArray[np.float64] | None:
    """(k, channels) standard deviations where any reading brings its own covariance; 0 for an index."""
    own = (chunk["flags"][rows] & HAS_R) != 0
    if not own.any():
        return None
    sigma = np.zeros((len(rows), channels))
    measured = channels if sensor.measured is None else sensor.measured
    sigma[:, :measured] = sensor.sigma or 0.0
    variances = np.diagonal(chunk["R"][rows], axis1=1, axis2=2)[:, :measured]
    sigma[own, :measured] = np.sqrt(np.maximum(variances[own], 0.0))
    return sigma
