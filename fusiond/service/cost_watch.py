"""What control costs, beside what it should cost with the sensors that work now."""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.assembly.assembly import Assembly
from fusiond.types import Health, Role

OUT = {int(Health.SILENT), int(Health.EXCLUDED), int(Health.PROBATION)}


class CostWatch:
    """The running cost of one daemon's commands, and the expected one.

    The engine's mean is that of the estimate; what the estimate does not know is added from its covariance.
    """

    def __init__(self, assembly: Assembly, engine: Any) -> None:
        self._engine, self._plan = engine, assembly.plan
        self._expected = {one.working: one.cost for one in assembly.expected_costs}
        self._updating = {s.number: s.name for s in assembly.layout.sensors if s.role is Role.UPDATE}
        self._told: dict[str, Any] = {}
        states = [slot.name for slot in assembly.layout.states]
        self._at = [states.index(name) for name in self._plan.states] if self._plan else []

    def observe(self, health: Any) -> None:
        """Take over the newest cost; `health` of every sensor by number."""
        plan, desk = self._plan, self._engine.desk[0]
        if plan is None:
            return
        working = frozenset(name for k, name in self._updating.items() if int(health[k]) not in OUT)
        running = None
        if desk["cost_count"]:
            n = len(self._at)
            P = self._engine.covariance()[np.ix_(self._at, self._at)]
            unknown = float(np.trace(plan.plant.cost[:n, :n] @ P))
            running = (float(desk["cost"]) + unknown) / plan.plant.period_s
        expected = self._expected.get(working)
        self._told = {"cost": {"running": running, "expected": expected}}

    def told(self) -> dict[str, Any]:
        """`{"cost": {"running", "expected"}}`, per second; empty where the law was not designed from a cost."""
        return self._told
