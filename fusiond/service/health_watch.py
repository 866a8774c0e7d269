"""Transitions of health, of every sensor and of the service, and what is wrong, as the reports bring them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.recording.fault_log import now_ns
from fusiond.recording.fault_words import FaultObject, fault_object
from fusiond.service.messages import HEALTH_LABELS, SERVICE_LABELS
from fusiond.types import Health, ServiceHealth


@dataclass(frozen=True, slots=True)
class Transition:
    """One change. `sensor` None: the service's own; `before` and `after` are labels of health.

    Args:
        fault: what is wrong with the sensor after it; the health may stay where only this has changed.
        model: of the service's own, whether the model, not a sensor, is thought wrong after it.
        row: of the report that told of it, in its batch.
    """

    t_ns: int
    sensor: str | None
    before: str
    after: str
    fault: FaultObject | None = None
    model: bool = False
    row: int = field(default=0, compare=False)


class HealthWatch:
    """The health last reported; before the first report every sensor is healthy and the service invalid."""

    def __init__(self, layout: Layout) -> None:
        self.sensors = [int(Health.HEALTHY)] * len(layout.sensors)
        self.service = int(ServiceHealth.INVALID)
        self.faults: list[FaultObject | None] = [None] * len(layout.sensors)
        self.model = False
        self._layout = layout
        self._names = [sensor.name for sensor in layout.sensors]
        fields: Any = layout.report.fields
        spans = [(fields[first][1], end_of(fields[last])) for first, last in SPANS]
        self._health, self._fault = (slice(*span) for span in spans)
        self._seen = (b"", b"")

    def known(self) -> dict[str, Any]:
        """What is known, for another daemon."""
        return {"sensors": self.sensors, "service": self.service, "faults": self.faults, "model": self.model}

    def know(self, known: Mapping[str, Any]) -> None:
        """Take over what another daemon knew."""
        self.sensors, self.service = list(known["sensors"]), int(known["service"])
        self.faults, self.model = list(known["faults"]), bool(known["model"])
        self._seen = (b"", b"")

    def observe(self, reports: NDArray[Any]) -> list[Transition]:
        """The changes in these reports, in order."""
        # Nearly always nothing has changed, which a comparison of bytes tells at once.
        if len(reports) == 1 and self._bytes(reports.tobytes()) == self._seen:
            return []
        found: list[Transition] = []
        for k in self._changes(reports):
            found += self._between(reports[k], k)
        self._seen = self._bytes(reports[-1:].tobytes())
        return found

    def _bytes(self, report: bytes) -> tuple[bytes, bytes]:
        return report[self._health], report[self._fault]

    def _changes(self, reports: NDArray[Any]) -> list[int]:
        """Indices of the first report and of every one that differs from the one before it."""
        if len(reports) == 1:
            return [0]
        raw = reports.view(np.uint8).reshape(len(reports), reports.itemsize)
        differs = np.zeros(len(reports) - 1, np.bool_)
        for span in (self._health, self._fault):
            differs |= (raw[1:, span] != raw[:-1, span]).any(axis=1)
        return [0, *(np.flatnonzero(differs) + 1).tolist()]

    def _between(self, report: Any, row: int) -> list[Transition]:
        """What leads from the health and the faults known to those of one report, which are known from then on."""
        t_ns, found = now_ns(report), []
        for number, name in enumerate(self._names):
            before, after = self.sensors[number], int(report["health"][number])
            fault = fault_object(self._layout, report, number)
            if before != after or fault != self.faults[number]:
                found.append(
                    Transition(t_ns, name, HEALTH_LABELS[before], HEALTH_LABELS[after], fault, row=row)
                )
                self.sensors[number], self.faults[number] = after, fault
        before, after, model = self.service, int(report["service"]), bool(report["model"])
        if before != after or model != self.model:
            labels = SERVICE_LABELS[before], SERVICE_LABELS[after]
            found.append(Transition(t_ns, None, *labels, model=model, row=row))
            self.service, self.model = after, model
        return found


SPANS = (("service", "health"), ("fault", "model"))
"""First and last field of each part of a report that tells of health and faults; they stand together in it."""


def end_of(field: tuple[np.dtype[Any], int]) -> int:
    """First byte after a field of a record."""
    kind, offset = field[:2]
    return offset + kind.itemsize
