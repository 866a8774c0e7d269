"""A recorded run as what its report shows: envelopes for the pictures, faults and counts for the tables."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.engine.records import Shape
from fusiond.errors import LogError
from fusiond.recording.accumulators import SensorSums
from fusiond.recording.description import Description, description_of
from fusiond.recording.fault_log import FaultLog
from fusiond.recording.mcap_blocks import McapFile
from fusiond.recording.report_envelope import Envelope
from fusiond.recording.report_traces import CommandTrace, HealthTrace, InputTrace, SensorTrace, StateTrace
from fusiond.recording.summary import SensorSummary
from fusiond.recording.truth import Truth
from fusiond.types import NANOSECONDS, RESET, TICK, Action, Role, Verdict

INTERVALS = 40_000
"""Intervals of all pictures together; more would make the page heavy and show no more."""
FINEST, COARSEST = 1000, 200
"""Most intervals of one picture, about one for each of its pixels, and fewest."""


class RunReport:
    """What one pass over a recording leaves.

    Args:
        layout: names, units and dtypes, as recorded.      config_text: the configuration it ran with, maybe empty.
        states, health, commands: traces; `sensors` of those that correct the state, `inputs` of those that drive it.
        counts: reports by what they are about.      notes: what is wrong with the recording, or could not be drawn.
        origin_ns, end_ns: first and last time.
    """

    def __init__(self, path: Path, layout: Layout, config_text: str, truth: Truth | None) -> None:
        self.path, self.layout, self.config_text, self.truth = path, layout, config_text, truth
        self.counts = {"readings": 0, "ticks": 0, "resets": 0, "late, replayed": 0, "time base jumps": 0}
        self.notes: list[str] = []
        self.recorded: dict[str, str] = {}
        self.origin_ns = self.end_ns = 0
        self._sums = SensorSums(layout)
        self._faults = FaultLog(layout)
        self._started = False

    def add(self, reports: NDArray[Any]) -> None:
        """Take one block of reports, in the order produced."""
        self._count(reports)
        self._faults.add(reports)
        if not self._started:
            first = np.flatnonzero(reports["sensor"] >= 0)
            if not len(first):
                return
            reports = reports[first[0] :]
            self._start(int(now_ns(reports[:1])[0]))
        t_ns = now_ns(reports)
        self.end_ns = max(self.end_ns, int(t_ns.max()))
        self.states.add(reports)
        self.health.add(t_ns, reports)
        self.commands.add(t_ns, reports)
        traces: list[SensorTrace | InputTrace] = [*self.sensors, *self.inputs]
        for trace in traces:
            mine = reports["sensor"] == trace.sensor.number
            if mine.any():
                trace.add(t_ns[mine], reports[mine])

    def summaries(self) -> dict[str, SensorSummary]:
        """Verdicts and faults of every sensor, its health at the end."""
        health = self.health.final if self._started else None
        return self._sums.summaries(health, self._faults.faults)

    def alarms(self) -> list[dict[str, Any]]:
        """When the model was blamed."""
        return self._faults.alarms()

    @property
    def started(self) -> bool:
        """Whether there was any reading."""
        return self._started

    @property
    def duration_s(self) -> float:
        """From the first reading to the last report, s."""
        return (self.end_ns - self.origin_ns) / NANOSECONDS

    def _count(self, reports: NDArray[Any]) -> None:
        self.counts["readings"] += self._sums.add(reports, self._sums.updating(reports))
        self.counts["ticks"] += int(np.count_nonzero(reports["sensor"] == TICK))
        self.counts["resets"] += int(np.count_nonzero(reports["sensor"] == RESET))
        self.counts["late, replayed"] += int(np.count_nonzero(reports["action"] == Action.REPLAYED))
        self.counts["time base jumps"] += int(np.count_nonzero(reports["action"] == Action.RETIMED))

    def _start(self, origin_ns: int) -> None:
        layout = self.layout
        self.origin_ns = self.end_ns = origin_ns
        roles = {role: [s for s in layout.sensors if s.role == role] for role in Role}
        panels = 2 * len(layout.states) + sum(2 * len(s.channels) + 2 for s in roles[Role.UPDATE])
        capacity = min(FINEST, max(COARSEST, INTERVALS // panels)) // 2 * 2

        def envelope(columns: int) -> Envelope:
            return Envelope(columns, capacity, origin_ns)

        self.states = StateTrace(layout, envelope, self.truth)
        self.health = HealthTrace(layout, envelope)
        self.commands = CommandTrace(layout, envelope)
        self.sensors = [SensorTrace(sensor, envelope, layout) for sensor in roles[Role.UPDATE]]
        self.inputs = [InputTrace(sensor, envelope, layout) for sensor in roles[Role.INPUT]]
        self._started = True


def now_ns(reports: NDArray[Any]) -> NDArray[np.int64]:
    """Times of the estimator when it made the reports: a reading may be late, or stamped wrongly."""
    state_t_ns = reports["state_t_ns"]
    later = np.maximum(reports["t_ns"], state_t_ns)
    return np.asarray(np.where(reports["verdict"] == Verdict.FROM_FUTURE, state_t_ns, later), np.int64)


def read_run(path: Path, truth: Truth | None = None) -> RunReport:
    """Read a recording of `run --record` or `replay --out`.

    Args:
        truth: compared with the states it names.
    Raises: LogError where it is no recording of fusiond, holds no reports, or those of another version; where truth
        names none of its states.
    """
    file = McapFile(path)
    description, head = described(file)
    blocks = file.blocks("reports")
    first = next(blocks, None)
    if first is None or not len(first):
        raise LogError(
            f"{path.name}: holds no reports, no reading was decided on; record while sensors publish "
            "(`fusiond run --record`), or use `fusiond replay LOG CONFIG --out`"
        )
    layout = layout_of(description, first.dtype, path, head.get("version", "?"))
    run = RunReport(path, layout, head.get("config", ""), narrowed(truth, layout))
    if truth is not None and run.truth is not None and len(run.truth.names) < len(truth.names):
        others = ", ".join(name for name in truth.names if name not in run.truth.names)
        run.notes.append(f"truth: {others} are no states of this run; they were not compared")
    run.add(first)
    for block in blocks:
        run.add(block)
    run.notes += file.warnings
    run.recorded = file.metadata.get("fusiond.end", {})
    return run


def angles_of(file: McapFile) -> set[str]:
    """Names of the states in rad. Raises LogError where fusiond did not write the file."""
    return {slot.name for slot in described(file)[0].states if slot.unit == "rad"}


def described(file: McapFile) -> tuple[Description, dict[str, str]]:
    """Names and units, and the whole head. Raises LogError where fusiond did not write it."""
    head = file.head()
    if not head:
        raise LogError(
            f"{file.path.name}: was not recorded by fusiond, so it holds no decisions to draw; give a run of "
            "`fusiond run --record` or `fusiond replay LOG CONFIG --out`"
        )
    try:
        return description_of(head["layout"]), head
    except (KeyError, TypeError, ValueError) as error:
        raise LogError(
            f"{file.path.name}: its metadata is not what fusiond writes ({error}); record or replay it again"
        ) from error


def layout_of(description: Description, dtype: np.dtype[Any], path: Path, version: str) -> Layout:
    """The layout of a recording's reports. Raises LogError where they are those of another version of fusiond."""
    slots = {name: getattr(description, name) for name in description.__slots__}
    shape = Shape(
        states=len(description.states), errors=len(description.errors), inputs=len(description.inputs), noises=0,
        sensors=len(description.sensors), filters=0, payload=payload_of(dtype), slots=0, model_parameters=0,
        sensor_parameters=0, law_parameters=0, controls=len(description.controls),
        references=len(description.references),
    )  # fmt: skip
    layout = Layout(**slots, filters=(), shape=shape)
    if layout.report != dtype:
        odd = ", ".join(unlike(layout.report, dtype))
        raise LogError(
            f"{path.name}: its reports were written by fusiond {version} and lack or change {odd}, which this version "
            "draws; make them anew with `fusiond replay RUN CONFIG --out NEW.mcap`"
        )
    return layout


def payload_of(dtype: np.dtype[Any]) -> int:
    """Numbers a reading may carry, by the field `z`; 1 where there is none."""
    fields: Any = dtype.fields or {}
    shape = fields["z"][0].shape if "z" in fields else ()
    return int(shape[0]) if shape else 1


def unlike(expected: np.dtype[Any], found: np.dtype[Any]) -> Iterator[str]:
    """Fields one has and the other has not, or not so."""
    a: Any = expected.fields or {}
    b: Any = found.fields or {}
    names = [name for name in {**a, **b} if name not in a or name not in b or a[name][0] != b[name][0]]
    yield from names or ["their order"]


def narrowed(truth: Truth | None, layout: Layout) -> Truth | None:
    """Truth of states alone: reports hold no derived outputs. Raises LogError where it names no state."""
    if truth is None:
        return None
    states = [slot.name for slot in layout.states]
    columns = [k for k, name in enumerate(truth.names) if name in states]
    if not columns:
        raise LogError(
            f"truth: has {', '.join(truth.names)}, none of which is a state; name columns after {', '.join(states)}"
        )
    names = tuple(truth.names[k] for k in columns)
    return Truth(truth.t_ns, names, truth.values[:, columns], truth.angles[columns])
