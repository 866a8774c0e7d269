"""What `replay --json` prints: the outcome of one run."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class SensorSummary:
    """One sensor's part of a run; used + rejected + late are its readings.

    Args:
        nis_mean: over the readings used, None for an input or where none was used.
        verdicts: readings by the name of their verdict.      faults: found wrong with it (`fault_log`).
    """

    used: int
    rejected: int
    late: int
    health: str
    nis_mean: float | None
    verdicts: dict[str, int]
    faults: tuple[dict[str, Any], ...] = ()

    def json_object(self) -> dict[str, Any]:
        """As it stands in the contract."""
        return {
            "used": self.used,
            "rejected": self.rejected,
            "late": self.late,
            "health": self.health,
            "nis_mean": self.nis_mean,
            "verdicts": self.verdicts,
            "faults": list(self.faults),
        }


@dataclass(frozen=True, slots=True)
class Summary:
    """One run.

    Args:
        readings: given to the engine, without ticks.
        final: time, state, std and health after the last event; empty where there was none.
        rmse: by name, of the states and outputs that truth has; None without truth.
        nees_mean: mean of e' P^-1 e over the states that truth has; expected value `nees_dof`, their number.
        refused: by reason, what the engine refused and what never became a reading.
        repairs: covariances that had to be repaired; the UD recursion needs none.
        guard: what the guard of the covariance met (`Engine.guard`); empty with a compiled step.
        model_alarms: when the model, not a sensor, was thought wrong.
        outside: by name, the share of the estimates compared whose error exceeded its protection level.
    """

    readings: int
    wall_s: float
    final: dict[str, Any]
    rmse: dict[str, float] | None
    nees_mean: float | None
    nees_dof: int
    compared: int
    sensors: dict[str, SensorSummary]
    refused: dict[str, int]
    resets: int
    output_sha256: str
    state_sha256: str
    repairs: int = 0
    guard: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    model_alarms: list[dict[str, Any]] = field(default_factory=list)
    outside: dict[str, float] = field(default_factory=dict)

    def json_object(self) -> dict[str, Any]:
        """The object of the contract; `rmse` and `nees_mean` only with truth."""
        out: dict[str, Any] = {"readings": self.readings, "wall_s": self.wall_s, "final": self.final}
        if self.rmse is not None:
            out |= {"rmse": self.rmse, "nees_mean": self.nees_mean, "nees_dof": self.nees_dof}
            out["compared"] = self.compared
        if self.outside:
            out["outside"] = self.outside
        return out | {
            "model": {"alarms": self.model_alarms},
            "sensors": {name: sensor.json_object() for name, sensor in self.sensors.items()},
            "refused": self.refused,
            "resets": self.resets,
            "repairs": self.repairs,
            **({"guard": self.guard} if self.guard else {}),
            "warnings": self.warnings,
            "output_sha256": self.output_sha256,
            "state_sha256": self.state_sha256,
        }
