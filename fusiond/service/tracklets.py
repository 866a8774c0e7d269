"""What a node sends: each used reading, with its model linearised at an estimate of that time.

A linear model is the same everywhere; one that bends is linearised at the center's estimate, at the node's own while
the center has none (`fusiond.service.center_view`). Sequence numbers are the node's, so that a gap at the center is a
loss between the two; they go on growing when a node starts anew. Layout: `fusiond.models.sensors.tracklet`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.resolve import Resolved, ResolvedSensor
from fusiond.engine.layout import Layout
from fusiond.engine.records import HAS_R
from fusiond.numerics.kernel import interpreted
from fusiond.service import reading_json, reading_record
from fusiond.service.center_view import CenterView
from fusiond.service.roles import bends
from fusiond.service.state_path import StatePath, Vector
from fusiond.types import Action, Role, Verdict, nanoseconds

Put = tuple[int, str, bytes]
"""Sensor number, encoding, payload."""
USED, HELD, REPLAYED = int(Verdict.USED), int(Verdict.HELD), int(Action.REPLAYED)
EPOCH_BITS = 22
"""Sequence numbers in a millisecond of epoch: more than any node sends."""


class Tracklets:
    """Turns a node's readings and reports into puts.

    Args:
        resolved, layout: of the node's part of the configuration.   epoch: ms since 1970 when this engine began.
    `withheld` counts, for each sensor by number, the readings that nobody knew where to linearise.
    """

    def __init__(self, resolved: Resolved, layout: Layout, epoch: int) -> None:
        self._models = {k: one for k, one in enumerate(resolved.sensors) if one.role is Role.UPDATE}
        places = {slot.name: place for place, slot in enumerate(layout.states)}
        self._at = {
            k: np.array([places[name] for name in one.model.reads]) for k, one in self._models.items()
        }
        angles = np.array([slot.name in resolved.process.angles for slot in layout.states])
        self._path = StatePath(angles)
        names = [slot.name for slot in layout.states]
        self.center = CenterView(names, angles, nanoseconds(resolved.config.health.invalid_s))
        self.bent = frozenset(k for k, one in self._models.items() if bends(resolved, one))
        self.withheld = dict.fromkeys(self._models, 0)
        self.begin(epoch)
        self._last: dict[int, list[float]] = {}

    def begin(self, epoch: int) -> None:
        """Number anew, in a later epoch."""
        self._seq = dict.fromkeys(self._models, epoch << EPOCH_BITS)

    def puts(self, readings: NDArray[Any], reports: NDArray[Any]) -> list[Put]:
        """One put for the used readings of each sensor in a batch; one more for each with a full R of its own."""
        records: dict[int, list[bytes]] = {}
        found: list[Put] = []
        for reading, report in zip(readings, reports, strict=True):
            number = int(report["sensor"])
            if number not in self._models:
                continue
            numbers = self._numbers(number, reading, report)
            if numbers is None:
                continue
            one = self._encoded(number, reading, numbers)
            if isinstance(one, bytes):
                records.setdefault(number, []).append(one)
            else:
                found.append((number, reading_json.ENCODING, one.encode()))
        return [*((k, reading_record.ENCODING, b"".join(some)) for k, some in records.items()), *found]

    def _numbers(self, number: int, reading: Any, report: Any) -> list[float] | None:
        """The numbers of one tracklet; None where the reading taught nothing.

        A repeated value goes out as the last one did, so that the center too sees it repeated.
        """
        verdict = int(report["verdict"])
        if verdict == HELD:
            return self._last.get(number)
        own = np.array(report["x"], dtype=np.float64)
        if verdict != USED or not np.isfinite(own).all():
            return None
        x = self._point(number, report, own)
        if x is None:
            self.withheld[number] += 1
            return None
        self._last[number] = linearised(self._models[number], self._at[number], reading["z"], x)
        return self._last[number]

    def _point(self, number: int, report: Any, own: Vector) -> Vector | None:
        """Where to linearise one reading, given the node's own newest state; None while that is not known."""
        section = self._models[number].section
        assert section is not None
        t_ns = int(report["t_ns"]) - nanoseconds(section.delay_s)
        if int(report["action"]) == REPLAYED:
            own = self._path.at(t_ns)
        else:
            self._path.note(int(report["state_t_ns"]), own)
        if number not in self.bent:
            return own
        where = self.center.where(t_ns)
        if not where.known:
            return None
        return own if where.x is None else where.x

    def _encoded(self, number: int, reading: Any, numbers: list[float]) -> bytes | str:
        """One reading on the wire: packed, or as JSON where it brought an R with covariances."""
        self._seq[number] += 1
        t_ns, seq = int(reading["t_ns"]), self._seq[number]
        if not int(reading["flags"]) & HAS_R:
            return reading_record.encode_record(numbers, t_ns, seq)
        m, size = self._models[number].model.dof, len(numbers)
        R = np.zeros((size, size))
        R[:m, :m] = reading["R"][:m, :m]
        if np.count_nonzero(R) == np.count_nonzero(np.diagonal(R)):
            return reading_record.encode_record(numbers, t_ns, seq, np.diagonal(R).tolist())
        return reading_json.encode_json(numbers, t_ns, seq, R.tolist())


def linearised(sensor: ResolvedSensor, at: NDArray[np.int64], z: Vector, x: Vector) -> list[float]:
    """measured, h(x), H(x) row by row, x of the states that the model reads.

    Args:
        at: (r,) places of those states.   z: the reading's numbers, at least as many as the sensor sends.
    """
    model, m = sensor.model, sensor.model.dof
    assert sensor.module is not None
    sent = len(model.channels)
    h, H = np.zeros(sent), np.zeros((sent, x.shape[0]))
    interpreted(sensor.module.observe)(x, z[:sent], at, np.array(model.parameters or (0.0,)), h, H)
    return [*z[:m].tolist(), *h[:m].tolist(), *H[:m, at].ravel().tolist(), *x[at].tolist()]
