"""What a node sends: each used reading, with its model linearised where the node's own filter was.

Its sequence numbers are the node's own, so that a gap at the center is a loss between the two; they go on growing
when a node starts anew. Layout of the numbers: `fusiond.models.sensors.tracklet`.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.resolve import Resolved, ResolvedSensor
from fusiond.engine.layout import Layout
from fusiond.engine.records import HAS_R
from fusiond.numerics.discretise import wrap_angle
from fusiond.numerics.kernel import interpreted
from fusiond.service import reading_json, reading_record
from fusiond.types import Action, Role, Verdict, nanoseconds

Vector = NDArray[np.float64]
Put = tuple[int, str, bytes]
"""Sensor number, encoding, payload."""
USED, HELD, REPLAYED = int(Verdict.USED), int(Verdict.HELD), int(Action.REPLAYED)
EPOCH_BITS = 22
"""Sequence numbers in a millisecond of epoch: more than any node sends."""
KEPT_STATES = 1024


class StatePath:
    """Where the filter was lately: what a late reading is linearised at.

    Args:
        angles: (states,) whether a state is an angle, rad.
    """

    def __init__(self, angles: NDArray[np.bool_]) -> None:
        self._angles = angles
        self._t_ns: deque[int] = deque(maxlen=KEPT_STATES)
        self._x: deque[Vector] = deque(maxlen=KEPT_STATES)

    def note(self, t_ns: int, x: Vector) -> None:
        """Remember a state, no older than the last; of one time the newest counts."""
        if self._t_ns and t_ns == self._t_ns[-1]:
            self._x[-1] = x
        elif not self._t_ns or t_ns > self._t_ns[-1]:
            self._t_ns.append(t_ns)
            self._x.append(x)
        else:  # the time base jumped back
            self._t_ns.clear()
            self._x.clear()
            self.note(t_ns, x)

    def at(self, t_ns: int) -> Vector:
        """The state then, between the two remembered around it; the first or last beyond them."""
        after = bisect_right(self._t_ns, t_ns)
        if after == 0 or after == len(self._t_ns):
            return self._x[0 if after == 0 else -1]
        before_ns, before = self._t_ns[after - 1], self._x[after - 1]
        apart = self._x[after] - before
        turn = interpreted(wrap_angle)
        apart = np.array([turn(a) if angle else a for a, angle in zip(apart, self._angles, strict=True)])
        moved: Vector = before + apart * ((t_ns - before_ns) / (self._t_ns[after] - before_ns))
        return moved


class Tracklets:
    """Turns a node's readings and reports into puts.

    Args:
        resolved, layout: of the node's part of the configuration.   epoch: ms since 1970 when this engine began.
    """

    def __init__(self, resolved: Resolved, layout: Layout, epoch: int) -> None:
        self._models = {k: one for k, one in enumerate(resolved.sensors) if one.role is Role.UPDATE}
        places = {slot.name: place for place, slot in enumerate(layout.states)}
        self._at = {
            k: np.array([places[name] for name in one.model.reads]) for k, one in self._models.items()
        }
        angles = np.array([slot.name in resolved.process.angles for slot in layout.states])
        self._path = StatePath(angles)
        self._seq = dict.fromkeys(self._models, epoch << EPOCH_BITS)
        self._last: dict[int, list[float]] = {}

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
        x = np.array(report["x"], dtype=np.float64)
        if verdict != USED or not np.isfinite(x).all():
            return None
        sensor = self._models[number]
        if int(report["action"]) == REPLAYED:
            assert sensor.section is not None
            x = self._path.at(int(report["t_ns"]) - nanoseconds(sensor.section.delay_s))
        else:
            self._path.note(int(report["state_t_ns"]), x)
        self._last[number] = linearised(sensor, self._at[number], reading["z"], x)
        return self._last[number]

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
