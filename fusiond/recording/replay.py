"""Replay: the same engine on recorded readings, as fast as it goes, with nothing kept but sums."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.engine import Engine
from fusiond.recording.accumulators import SensorSums, TruthSums
from fusiond.recording.digest import OutputDigest
from fusiond.recording.fault_log import FaultLog
from fusiond.recording.mcap_writer import McapWriter
from fusiond.recording.refusals import Refusals
from fusiond.recording.summary import Summary
from fusiond.recording.truth import Truth
from fusiond.recording.views import Thinning, estimate_message, protection_part
from fusiond.types import ServiceHealth, seconds

Witness = Callable[[NDArray[Any], NDArray[Any]], None]
"""Sees readings and their reports, of which the next call of the engine overwrites the latter."""
EPOCH = "replay"
"""Epoch of the estimates a replay writes: no daemon was started."""


def replay(
    engine: Engine,
    chunks: Iterable[NDArray[Any]],
    *,
    truth: Truth | None = None,
    writer: McapWriter | None = None,
    progress: Callable[[int], None] | None = None,
    refusals: Refusals | None = None,
    estimate_hz: float = 20.0,
    witness: Witness | None = None,
) -> Summary:
    """Run every reading through the engine, in the order given, and sum up.

    Args:
        engine: fresh; it keeps the final state.
        chunks: arrays of `engine.layout.reading` in arrival order, ticks included. A log is one; so is any
            wrapper.
        truth: compared at the state time of every reading that conditioned the state.
        writer: gets readings, reports, and estimates at most `estimate_hz` times a second; the caller closes
            it.
        progress: called after each chunk with the number of events so far.
        refusals: what the log refused, read when `chunks` has ended.
        witness: sees every chunk with its reports, which it copies if it keeps them.
    """
    run = Run(engine, truth, writer, estimate_hz, witness)
    started = time.perf_counter()
    for readings in chunks:
        run.feed(readings)
        if progress is not None:
            progress(run.events)
    return run.summary(time.perf_counter() - started, refusals)


class Run:
    """The sums of one replay while it goes on."""

    def __init__(
        self, engine: Engine, truth: Truth | None, writer: McapWriter | None, estimate_hz: float,
        witness: Witness | None = None,
    ) -> None:  # fmt: skip
        self.events = 0
        self._readings = 0
        self._engine = engine
        self._writer = writer
        self._witness = witness
        self._thinning = Thinning(estimate_hz)
        self._estimates = 0
        self._sensors = SensorSums(engine.layout)
        self._faults = FaultLog(engine.layout)
        self._truth = None if truth is None else TruthSums(engine.layout, truth, engine.outputs)
        self._digest = OutputDigest()
        self._last: Any = None

    def feed(self, readings: NDArray[Any]) -> None:
        """Process one chunk."""
        if not len(readings):
            return
        covariances = self._truth is not None and self._truth.needs_covariances
        reports = self._engine.process(readings, covariances=covariances)
        self.events += len(reports)
        self._digest.update(reports)
        updating = self._sensors.updating(reports)
        self._readings += self._sensors.add(reports, updating)
        self._faults.add(reports)
        if self._truth is not None and updating.any():
            P = self._engine.covariances[: len(reports)][updating] if covariances else None
            self._truth.add(reports[updating], P)
        if self._writer is not None:
            self._write(self._writer, readings, reports, updating)
        if self._witness is not None:
            self._witness(readings, reports)
        self._last = reports[-1].copy()

    def summary(self, wall_s: float, refusals: Refusals | None) -> Summary:
        """The outcome so far."""
        refused = {verdict.label: number for verdict, number in self._sensors.by_verdict().items()}
        for name, number in (refusals.by_name() if refusals else {}).items():
            refused[name] = refused.get(name, 0) + number
        truth = self._truth
        health = None if self._last is None else np.asarray(self._last["health"])
        unused = truth.unused if truth else []
        return Summary(
            readings=self._readings,
            wall_s=wall_s,
            final=self._final(),
            rmse=truth.rmse() if truth else None,
            outside=truth.outside() if truth else {},
            nees_mean=truth.nees_mean() if truth else None,
            nees_dof=len(truth.state_columns) if truth else 0,
            compared=truth.count if truth else 0,
            sensors=self._sensors.summaries(health, self._faults.faults),
            refused=refused,
            resets=int(self._engine.track["resets"][0]),
            output_sha256=self._digest.hexdigest(),
            state_sha256=self._engine.state_sha256(),
            repairs=self._engine.repairs,
            guard=self._engine.guard(),
            warnings=[
                *(refusals.messages() if refusals else []),
                *(f"truth: the model has no {name}; that column was not compared" for name in unused),
                *(
                    ["truth: covers no moment of the log; compare their times"]
                    if truth and not truth.count
                    else []
                ),
            ],
            model_alarms=self._faults.alarms(),
        )

    def _final(self) -> dict[str, Any]:
        if self._last is None:
            return {}
        last, layout = self._last, self._engine.layout
        names = [slot.name for slot in layout.states]
        x = np.asarray(last["x"], dtype=np.float64)
        final = {
            "t_s": seconds(int(last["state_t_ns"])),
            "state": dict(zip(names, x.tolist(), strict=False)),
            "std": dict(
                zip([slot.name for slot in layout.errors], np.asarray(last["std"]).tolist(), strict=False)
            ),
            "health": ServiceHealth(int(last["service"])).label,
        }
        final |= protection_part(layout, last)
        return final | ({"outputs": self._engine.outputs(x)} if layout.outputs else {})

    def _write(
        self, writer: McapWriter, readings: NDArray[Any], reports: NDArray[Any], updating: NDArray[np.bool_]
    ) -> None:
        writer.readings(readings)
        writer.reports(reports)
        if not updating.any():
            return
        for report in self._thinning.pick(reports[updating]):
            message = estimate_message(self._engine.layout, report, self._estimates, EPOCH)
            t_ns = int(report["state_t_ns"])
            writer.message("estimate", message, t_ns, int(report["arrival_ns"]) or t_ns)
            self._estimates += 1
