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
        self.sensors: NDArray[Any] = np.full(len(layout.sensors), int(Health.HEALTHY), np.int32)
        self.service = int(ServiceHealth.INVALID)
        self._names = [sensor.name for sensor in layout.sensors]

    def observe(self, reports: NDArray[Any]) -> list[Transition]:
        """The changes in these reports, in order."""
        health = reports["health"][:, : len(self._names)]
        service = reports["service"]
        if (health == self.sensors).all() and (service == self.service).all():
            return []
        found: list[Transition] = []
        for k, report in enumerate(reports):
            t_ns = int(report["t_ns"])
            for i in np.flatnonzero(health[k] != self.sensors):
                before, after = HEALTH_LABELS[self.sensors[i]], HEALTH_LABELS[health[k, i]]
                found.append(Transition(t_ns, self._names[i], before, after))
            if service[k] != self.service:
                found.append(Transition(t_ns, None, SERVICE_LABELS[self.service], SERVICE_LABELS[service[k]]))
            self.sensors, self.service = health[k].copy(), int(service[k])
        return found
