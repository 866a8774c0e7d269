"""The engine: one configuration's compiled step with its records, fed with arrays of readings."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.direct import Run, direct
from fusiond.engine.judge import Judge
from fusiond.engine.layout import Layout
from fusiond.engine.overseer import Overseer
from fusiond.engine.records import JUDGED, TO_JUDGE, TO_REPLAY, work_dtype
from fusiond.engine.step.sizes import SNAPSHOT_EVERY
from fusiond.errors import EngineFault

Records = NDArray[Any]
Derive = Callable[[Any, Any, Any], None]


MEMORY = 512
"""Snapshots kept where faults are judged: an exclusion goes back to before the fault began."""


class Engine:
    """Runs readings through the step and keeps the history that late ones need.

    Args:
        layout: what the records mean.   design: (1,) design record.   desk: (1,) desk record to start from.
        run: the compiled entry.   derive: writes the derived outputs of a state, None where there are none.
        judge: decides about alarms, None without fault detection.   overseer: judges for a plain step.
    """

    def __init__(
        self,
        layout: Layout,
        design: Records,
        desk: Records,
        run: Run,
        derive: Derive | None,
        judge: Judge | None = None,
        overseer: Overseer | None = None,
    ) -> None:
        self.layout = layout
        self.track: Records = np.zeros(1, layout.track)
        self.desk: Records = desk.copy()
        self._design, self._run, self._derive = design, run, derive
        self._is_direct = False
        self._judge, self._overseer = judge, overseer
        self._reading = layout.reading
        self._first_desk = desk.copy()
        self._work = np.zeros(1, work_dtype(layout.shape))
        self._spares = (
            np.zeros(1, layout.track),
            np.zeros(1, layout.report),
            np.zeros(1, layout.reading),
        )
        self._reports: Records = np.zeros(0, layout.report)
        self._report: Records = np.zeros(1, layout.report)
        self._report_bytes = self._report.view(np.uint8).data
        self._blank = bytes(layout.report.itemsize)
        self.covariances: NDArray[np.float64] = np.zeros((0, layout.shape.errors, layout.shape.errors))
        self._nobody_asks = self.covariances
        self.reset()

    def reset(self) -> None:
        """Forget everything: the state before the first reading."""
        self.track[:] = np.zeros(1, self.layout.track)
        self.desk[:] = self._first_desk
        if self._overseer is not None:
            self._overseer.reset()
        self._allocate((MEMORY if self._judge or self._overseer else 64) * SNAPSHOT_EVERY)

    def process(self, readings: Records, *, covariances: bool = False) -> Records:
        """Run readings through the step, in the order they arrived.

        Args:
            readings: (k,) records of `layout.reading`; one whose sensor is TICK or RESET is that event.
            covariances: also keep the centralized covariance after each reading, in `self.covariances[:k]`.
        Returns:
            (k,) reports, in the same order: a view that the next call overwrites.
        """
        count = readings.shape[0]
        if readings.dtype is not self._reading or (count > 1 and not readings.flags.c_contiguous):
            readings = np.ascontiguousarray(readings, self._reading)
        if count == 1 and not covariances:
            self._report_bytes[:] = self._blank
            reports, into = self._report, self._nobody_asks
        else:
            reports, into = self._room(count, covariances)
        if self._overseer is None:
            self._take(readings, reports, into)
            return reports
        for k in range(count):
            self._overseer.lead(self, readings[k : k + 1])
            self._take(readings[k : k + 1], reports[k : k + 1], into[k : k + 1])
        return reports

    def _take(self, readings: Records, reports: Records, into: NDArray[np.float64]) -> None:
        """Have the step take all of the readings, growing the history and judging alarms where it stops for that."""
        count = readings.shape[0]
        done = self._step(readings, reports, into)
        while done < count:
            if self.desk[0]["pause"] == TO_JUDGE:
                self._judge_alarm()
            else:
                self._grow()
            done += self._step(readings[done:], reports[done:], into[done:])

    def _judge_alarm(self) -> None:
        """Let the judge decide about the alarm in the track, and have its reading's report finished."""
        assert self._judge is not None
        self._judge.consider(self)
        self.track[0]["monitor"]["alarm"] = 0
        self.desk[0]["pause"] = JUDGED

    def replay_since(self, t_ns: int) -> None:
        """Apply the readings of the history once more, from the last snapshot before t_ns or else the oldest kept."""
        marks = self._marks
        kept = np.flatnonzero(marks >= self.desk[0]["ring_first"])
        if not kept.size:
            return
        started = self._snapshots["started"][kept] != 0
        early = kept[started & (self._snapshots["t_ns"][kept] < t_ns)]
        if not early.size:
            early = kept[started][:]
            if not early.size:
                return
            chosen = early[np.argmin(marks[early])]
        else:
            chosen = early[np.argmax(marks[early])]
        self.desk[0]["replay_from"] = marks[chosen]
        self.desk[0]["pause"] = TO_REPLAY
        self._step(np.zeros(1, self._reading), np.zeros(1, self.layout.report), self._nobody_asks)

    @property
    def judging(self) -> Engine | None:
        """The compiled engine that judges for a plain one; None where this one judges for itself, or nobody does."""
        return self._overseer.engine if self._overseer is not None else None

    @property
    def histories(self) -> tuple[Records, Records]:
        """The track now, (1,), and its kept snapshots, (k,); a decision must reach them all."""
        return self.track, self._snapshots

    @property
    def horizon_ns(self) -> int:
        """How much older than the newest a reading may be, for readings of different ages to be put in order."""
        return int(self._design[0]["horizon_ns"])

    @property
    def window(self) -> Records:
        """Entries of the window, oldest first: what the last readings were to the primary filter, looks included."""
        ring = self._work[0]["window"]
        entries = int(self.track[0]["monitor"]["entries"])
        count = min(entries, len(ring))
        return np.asarray(ring[np.arange(entries - count, entries) % len(ring)])

    def recent(self, sensor: int) -> Records:
        """(k,) readings of a sensor within the horizon, as they were sent, oldest first."""
        ring = self._ring[[place % self._ring.shape[0] for place in self._places()]]
        return np.asarray(ring[ring["sensor"] == sensor])

    def _room(self, count: int, covariances: bool) -> tuple[Records, NDArray[np.float64]]:
        """Zeroed reports for `count` readings, and as many covariances or none."""
        if self._reports.shape[0] < count:
            self._reports = np.zeros(count, self.layout.report)
        reports = self._reports[:count]
        reports.view(np.uint8)[:] = 0
        if not covariances:
            return reports, self._nobody_asks
        n = self.layout.shape.errors
        if self.covariances.shape[0] < count:
            self.covariances = np.zeros((count, n, n))
        return reports, self.covariances[:count]

    def _step(self, readings: Records, reports: Records, into: NDArray[np.float64]) -> int:
        """Call the step; the first call, which compiles it, also finds the way past its dispatcher."""
        taken = self._run(*self._kept, readings, reports, into)
        if not self._is_direct:
            self._run, self._is_direct = direct(self._run), True
        return taken

    def outputs(self, x: NDArray[np.float64]) -> dict[str, float]:
        """Derived outputs of one state vector (n,), by name."""
        if self._derive is None:
            return {}
        y = np.zeros(len(self.layout.outputs))
        self._derive(x, self._design[0]["p"], y)
        return {slot.name: float(value) for slot, value in zip(self.layout.outputs, y, strict=True)}

    def covariance(self, row: int = 0) -> NDArray[np.float64]:
        """The covariance now, (n, n), of the errors of one filter of the bank; row 0 is the centralized one."""
        if self.layout.plain:
            return np.array(self.track[0]["P"][row])
        U = np.triu(self.track[0]["U"][row], 1) + np.eye(self.layout.shape.errors)
        covariance: NDArray[np.float64] = (U * self.track[0]["d"][row]) @ U.T
        if self.layout.shape.lazy and self.track[0]["pending"][row]:
            F = self.track[0]["pending_F"][row]
            covariance = F @ covariance @ F.T + self.track[0]["pending_Q"][row]
        return covariance

    def initial_covariance(self) -> NDArray[np.float64]:
        """(n, n) what a track begins with."""
        U = np.triu(self._design[0]["U0"], 1) + np.eye(self.layout.shape.errors)
        return np.asarray((U * self._design[0]["d0"]) @ U.T)

    @property
    def angles(self) -> NDArray[np.bool_]:
        """(states,) whether a state is an angle, rad."""
        return np.array(self._design[0]["angle"], dtype=bool)

    @property
    def repairs(self) -> int:
        """Covariances repaired so far; the factors U, d never need it."""
        return int(self.track[0]["repairs"]) if self.layout.plain else 0

    def guard(self) -> dict[str, float]:
        """What the guard of the covariance met so far; empty where the recursion needs none.

        `repairs`, of which `unsound` were not enough; `largest`, `last`: the largest and the last change, in the
        repaired standard deviations; `condition`: the largest condition number of the correlations.
        """
        if not self.layout.plain:
            return {}
        track = self.track[0]
        names = {
            "repairs": "repairs",
            "unsound": "unsound",
            "largest": "repair_size",
            "last": "repair_last",
            "condition": "condition",
        }
        return {name: float(track[field]) for name, field in names.items()}

    def honest_covariance(self) -> NDArray[np.float64] | None:
        """True covariance (n, n) beside the one that seed 004's averaged gain reports; None with other topologies."""
        return np.array(self.track[0]["honest"]) if self.layout.topology == "seed_averaged" else None

    def dof(self, sensor: int) -> int:
        """Channels that a sensor measures."""
        return int(self._design[0]["dof"][sensor])

    def adapts(self, sensor: int) -> bool:
        """Whether the sensor's noise is estimated."""
        return self.layout.shape.adapt is not None and bool(self._design[0]["noise"]["adapts"][sensor])

    def noise_limits(self, sensor: int) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        """Smallest and largest R / declared by channel, and the share of the slow R left after a reading."""
        made = self._design[0]["noise"]
        return made["floor"][sensor], made["ceiling"][sensor], float(made["slow_forget"])

    def state_sha256(self) -> str:
        """Hash of the track record's bytes."""
        return hashlib.sha256(self.track.tobytes()).hexdigest()

    def memory(self) -> dict[str, Records]:
        """All that is remembered, live, by name; an overseer's engine's too. `remember` goes on from it."""
        names = ("track", "desk", "work", "ring", "snapshots", "marks")
        records = (self.track, self.desk, self._work, self._ring, self._snapshots, self._marks)
        own = dict(zip(names, records, strict=True))
        if self._overseer is None:
            return own
        return own | {f"overseer.{name}": one for name, one in self._overseer.engine.memory().items()}

    def remember(self, memory: Mapping[str, Records]) -> None:
        """Go on from what an engine of the same configuration remembered."""
        self._allocate(len(memory["ring"]))
        for name, records in self.memory().items():
            if "." not in name:
                records[:] = memory[name]
        if self._overseer is not None:
            start = "overseer."
            theirs = {name.removeprefix(start): one for name, one in memory.items() if name.startswith(start)}
            self._overseer.engine.remember(theirs)

    def _allocate(self, capacity: int) -> None:
        """Make an empty history for `capacity` readings, a multiple of SNAPSHOT_EVERY."""
        kept = capacity // SNAPSHOT_EVERY + 2
        self._ring: Records = np.zeros(capacity, self.layout.reading)
        self._snapshots: Records = np.zeros(kept, self.layout.track)
        self._marks: NDArray[np.int64] = np.full(kept, -1, np.int64)
        # The step's first arguments, which are the same for every call until the history grows.
        self._kept = (
            self.track, self.desk, self._design, self._work, self._spares,
            self._ring, self._snapshots, self._marks,
        )  # fmt: skip

    def _grow(self) -> None:
        """Double the history: a reading inside the horizon must always find its place."""
        ring, snapshots, marks = self._ring, self._snapshots, self._marks
        if self.desk[0]["ring_count"] < ring.shape[0]:
            raise EngineFault("the step stopped with room in its history")
        self._allocate(2 * ring.shape[0])
        for place in self._places():
            self._ring[place % self._ring.shape[0]] = ring[place % ring.shape[0]]
        for slot in np.flatnonzero(marks >= 0):
            mark = marks[slot]
            self._snapshots[mark // SNAPSHOT_EVERY % self._marks.shape[0]] = snapshots[slot]
            self._marks[mark // SNAPSHOT_EVERY % self._marks.shape[0]] = mark

    def _places(self) -> Iterator[int]:
        """Absolute numbers of the readings in the ring."""
        first = int(self.desk[0]["ring_first"])
        return iter(range(first, first + int(self.desk[0]["ring_count"])))
