"""Sums over the reports of a run: everything a summary needs, in memory that does not grow with the run."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.errors import LogError
from fusiond.recording.fault_words import FaultObject
from fusiond.recording.summary import SensorSummary
from fusiond.recording.truth import Truth
from fusiond.types import Health, Role, Verdict

VERDICTS = max(Verdict) + 1


class Outputs(Protocol):
    """Derived outputs of one state vector (n,), by name: `Engine.outputs`."""

    def __call__(self, x: NDArray[np.float64], /) -> dict[str, float]:
        """The outputs of x."""


class SensorSums:
    """Verdicts and normalised innovations, sensor by sensor."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        sensors = max(1, len(layout.sensors))
        self.verdicts = np.zeros((sensors, VERDICTS), np.int64)
        self._nis_sum = np.zeros(sensors)
        self._nis_count = np.zeros(sensors, np.int64)
        roles = [sensor.role == Role.UPDATE for sensor in layout.sensors]
        self._updates = np.array(roles or [False], dtype=np.bool_)

    def updating(self, reports: NDArray[Any]) -> NDArray[np.bool_]:
        """Which reports are of readings that conditioned the state."""
        used = (reports["sensor"] >= 0) & (reports["verdict"] == Verdict.USED)
        mask: NDArray[np.bool_] = used & self._updates[np.maximum(reports["sensor"], 0)]
        return mask

    def add(self, reports: NDArray[Any], updating: NDArray[np.bool_]) -> int:
        """Count one block; returns how many of its reports are of readings, not events."""
        readings = reports["sensor"] >= 0
        sensor, verdict = reports["sensor"][readings], reports["verdict"][readings]
        size = self.verdicts.size
        self.verdicts += np.bincount(sensor * VERDICTS + verdict, minlength=size).reshape(self.verdicts.shape)
        measured = updating & (reports["dof"] > 0)
        at = reports["sensor"][measured]
        self._nis_sum += np.bincount(at, reports["nis"][measured], minlength=len(self._nis_sum))
        self._nis_count += np.bincount(at, minlength=len(self._nis_count))
        return int(np.count_nonzero(readings))

    def by_verdict(self) -> dict[Verdict, int]:
        """Readings refused, over all sensors, by verdict."""
        totals = self.verdicts.sum(axis=0)
        return {v: int(totals[v]) for v in Verdict if v != Verdict.USED and totals[v]}

    def summaries(
        self, health: NDArray[np.int32] | None, faults: Callable[[int], tuple[FaultObject, ...]]
    ) -> dict[str, SensorSummary]:
        """One summary for each sensor; `health` as in the last report, None before any; `faults` by its number."""
        out = {}
        for sensor in self._layout.sensors:
            counts = self.verdicts[sensor.number]
            used, late = int(counts[Verdict.USED]), int(counts[Verdict.TOO_LATE])
            n = int(self._nis_count[sensor.number])
            out[sensor.name] = SensorSummary(
                used=used,
                rejected=int(counts.sum()) - used - late,
                late=late,
                health=(Health.HEALTHY if health is None else Health(int(health[sensor.number]))).label,
                nis_mean=float(self._nis_sum[sensor.number] / n) if n else None,
                verdicts={v.label: int(counts[v]) for v in Verdict if counts[v]},
                faults=faults(sensor.number),
            )
        return out


class TruthSums:
    """Errors against truth at the times of the estimates: RMSE by name, NEES over the states truth has.

    Where levels were asked for, also how often an error exceeded its protection level.
    """

    def __init__(self, layout: Layout, truth: Truth, outputs: Outputs) -> None:
        states = [slot.name for slot in layout.states]
        derived = [slot.name for slot in layout.outputs]
        self.names = [name for name in truth.names if name in states or name in derived]
        if not self.names:
            raise LogError(
                f"--truth: has {', '.join(truth.names)}, none of which the model has; name columns after its states "
                f"({', '.join(states)}) or outputs ({', '.join(derived) or 'none'})"
            )
        columns = [truth.names.index(name) for name in self.names]
        self.unused = [name for name in truth.names if name not in self.names]
        self._truth = Truth(truth.t_ns, tuple(self.names), truth.values[:, columns], truth.angles[columns])
        self._outputs = outputs
        errors = [slot.name for slot in layout.errors]
        self._from_state = [states.index(name) if name in states else -1 for name in self.names]
        self.state_columns = [k for k, name in enumerate(self.names) if name in states and name in errors]
        self._states = [errors.index(self.names[k]) for k in self.state_columns]
        self._levels = {slot.name: k for k, slot in enumerate(layout.protected) if slot.name in self.names}
        self._outside = np.zeros(len(self._levels), np.int64)
        self._square_sum = np.zeros(len(self.names))
        self._nees_sum = 0.0
        self._nees_count = 0
        self.count = 0

    @property
    def needs_covariances(self) -> bool:
        """Whether truth has any state at all."""
        return bool(self._states)

    def add(self, reports: NDArray[Any], covariances: NDArray[np.float64] | None) -> None:
        """Add reports of updating sensors; covariances: (K, n, n), None where none are needed."""
        truth, covered = self._truth.at(reports["state_t_ns"])
        x = reports["x"][covered]
        error = self._truth.errors(self._estimates(x), truth[covered])
        self._square_sum += np.sum(error**2, axis=0)
        self.count += len(x)
        for k, (name, at) in enumerate(self._levels.items()):
            exceeded = np.abs(error[:, self.names.index(name)]) > reports["protection"][covered, at]
            self._outside[k] += int(np.count_nonzero(exceeded))
        if covariances is None or not self._states or not len(x):
            return
        P = covariances[covered][:, self._states][:, :, self._states]
        nees = nees_of(error[:, self.state_columns], P)
        finite = np.isfinite(nees)
        self._nees_sum += float(np.sum(nees[finite]))
        self._nees_count += int(np.count_nonzero(finite))

    def rmse(self) -> dict[str, float]:
        """Root mean square error by name; empty where truth covered no estimate."""
        if not self.count:
            return {}
        return dict(zip(self.names, np.sqrt(self._square_sum / self.count).tolist(), strict=True))

    def outside(self) -> dict[str, float]:
        """Share of estimates outside their protection level, by the names that have one and a truth."""
        if not self.count:
            return {}
        return dict(zip(self._levels, (self._outside / self.count).tolist(), strict=True))

    def nees_mean(self) -> float | None:
        """Mean NEES, None where there was none."""
        return self._nees_sum / self._nees_count if self._nees_count else None

    def _estimates(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        out = np.empty((len(x), len(self.names)))
        for column, at in enumerate(self._from_state):
            if at >= 0:
                out[:, column] = x[:, at]
        if any(at < 0 for at in self._from_state):
            for row, state in enumerate(x):
                derived = self._outputs(state)
                for column, at in enumerate(self._from_state):
                    if at < 0:
                        out[row, column] = derived[self.names[column]]
        return out


def nees_of(error: NDArray[np.float64], P: NDArray[np.float64]) -> NDArray[np.float64]:
    """e' P^-1 e for each row: error (K, m), P (K, m, m). NaN where P is singular."""
    try:
        solved = np.linalg.solve(P, error[:, :, None])[:, :, 0]
    except np.linalg.LinAlgError:
        return np.array([nees_of_one(e, p) for e, p in zip(error, P, strict=True)])
    return np.asarray(np.sum(error * solved, axis=1))


def nees_of_one(error: NDArray[np.float64], P: NDArray[np.float64]) -> float:
    """The same for one row."""
    try:
        return float(error @ np.linalg.solve(P, error))
    except np.linalg.LinAlgError:
        return float("nan")
