"""Transitions of health, of every sensor and of the service, as the reports bring them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.service.messages import HEALTH_LABELS, SERVICE_LABELS
from fusiond.types import Health, ServiceHealth


@dataclass(frozen=True, slots=True)
class Transition:
    """One change. `sensor` None: the service's own; `before` and `after` are labels."""

    t_ns: int
    sensor: str | None
    before: str
    after: str


class HealthWatch:
    """The health last reported; before the first report every sensor is healthy and the service invalid."""

    def __init__(self, layout: Layout) -> None:
        self.sensors = [int(Health.HEALTHY)] * len(layout.sensors)
        self.service = int(ServiceHealth.INVALID)
        self._names = [sensor.name for sensor in layout.sensors]
        fields: Any = layout.report.fields
        first, health = fields["service"][1], fields["health"]
        self._at = slice(first, health[1] + health[0].itemsize)
        self._seen = b""

    def observe(self, reports: NDArray[Any]) -> list[Transition]:
        """The changes in these reports, in order."""
        # Nearly always nothing has changed, which a comparison of bytes tells at once.
        if len(reports) == 1 and reports.tobytes()[self._at] == self._seen:
            return []
        found: list[Transition] = []
        services, health = reports["service"], reports["health"][:, : len(self._names)]
        for k in changes(services, health):
            service, sensors = int(services[k]), health[k].tolist()
            if service == self.service and sensors == self.sensors:
                continue
            t_ns = int(reports["t_ns"][k])
            for name, before, after in zip(self._names, self.sensors, sensors, strict=True):
                if before != after:
                    found.append(Transition(t_ns, name, HEALTH_LABELS[before], HEALTH_LABELS[after]))
            if service != self.service:
                found.append(Transition(t_ns, None, SERVICE_LABELS[self.service], SERVICE_LABELS[service]))
            self.sensors, self.service = sensors, service
        self._seen = reports[-1:].tobytes()[self._at]
        return found


def changes(services: NDArray[Any], health: NDArray[Any]) -> list[int]:
    """Indices of the first report and of every one that differs from the one before it."""
    if len(services) == 1:
        return [0]
    differs = (services[1:] != services[:-1]) | (health[1:] != health[:-1]).any(axis=1)
    return [0, *(np.flatnonzero(differs) + 1).tolist()]
