"""What is drawn of a run, gathered report by report: states, innovations, noise, health and commands."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout, SensorLayout
from fusiond.recording.report_envelope import Envelope
from fusiond.recording.truth import Truth
from fusiond.types import Health, ServiceHealth, Slot, Verdict

NewEnvelope = Callable[[int], Envelope]
"""Makes an envelope of so many columns."""

BAND = 3.0
"""Half width of every band, in standard deviations."""
SEVERITY = (Health.HEALTHY, Health.PROBATION, Health.SUSPECT, Health.FAULTY, Health.SILENT, Health.EXCLUDED)
"""From good to bad: where an interval saw several, the worst is shown."""


class StateTrace:
    """States with their bands, and their errors where there is truth.

    Args:
        lines: x and the lower and upper end of its band, three columns a state; no number where it has no std.
        widths: half width of each band.
        errors: x - truth for each of `truth.names`, None without truth.
        inside: of those, share of reports where the error was within its band.
    """

    def __init__(self, layout: Layout, envelope: NewEnvelope, truth: Truth | None) -> None:
        self.slots: tuple[Slot, ...] = layout.states
        self.truth = truth
        names = [slot.name for slot in self.slots]
        errors = [slot.name for slot in layout.errors]
        self._std = [errors.index(name) if name in errors else -1 for name in names]
        self.lines, self.widths = envelope(3 * len(names)), envelope(len(names))
        self.compared = [] if truth is None else [names.index(name) for name in truth.names]
        self.errors = None if truth is None else envelope(len(truth.names))
        self._inside = np.zeros(len(self.compared))
        self._seen = np.zeros(len(self.compared))

    def add(self, reports: NDArray[Any]) -> None:
        """Take a block."""
        t_ns, x = reports["state_t_ns"], reports["x"][:, : len(self.slots)]
        wide = np.full(x.shape, np.nan)
        for k, at in enumerate(self._std):
            if at >= 0:
                wide[:, k] = BAND * reports["std"][:, at]
        self.lines.add(t_ns, np.stack([x, x - wide, x + wide], axis=2).reshape(len(x), -1))
        self.widths.add(t_ns, wide)
        if self.truth is None or self.errors is None:
            return
        known, covered = self.truth.at(t_ns)
        error = self.truth.errors(x[covered][:, self.compared], known[covered])
        self.errors.add(t_ns[covered], error)
        band = wide[covered][:, self.compared]
        self._inside += np.count_nonzero(np.abs(error) <= band, axis=0)
        self._seen += np.count_nonzero(np.isfinite(error) & np.isfinite(band), axis=0)

    def inside(self) -> dict[str, float]:
        """Share of the reports whose error was within the band, by state; states without a std are left out."""
        names = () if self.truth is None else self.truth.names
        return {name: float(i / n) for name, i, n in zip(names, self._inside, self._seen, strict=True) if n}


class SensorTrace:
    """Innovations, NIS and noise of one sensor that corrects the state.

    Args:
        channels: those with an innovation.
        nu, missed: innovation of the readings used, and of those weighed and not used; a column a channel.
        sigma, ratio: half width of the innovation's band, R used over R declared; a column a channel.
        nis: NIS of the readings used, and the limit.      marks: NIS of readings gated, of readings excluded, and 0
            where a reading was refused for another reason; no number where there was none.
    """

    def __init__(self, sensor: SensorLayout, envelope: NewEnvelope, layout: Layout) -> None:
        self.sensor = sensor
        self._most = min(len(sensor.channels), layout.shape.payload)
        self.nu, self.missed, self.sigma, self.ratio = (envelope(self._most) for _ in range(4))
        self.nis, self.marks = envelope(2), envelope(3)
        self._measured = 0

    @property
    def channels(self) -> tuple[Slot, ...]:
        """Those an innovation was ever taken of: an index has none."""
        return self.sensor.channels[: self._measured]

    def add(self, t_ns: NDArray[np.int64], reports: NDArray[Any]) -> None:
        """Take this sensor's reports."""
        verdict, nis = reports["verdict"], reports["nis"]
        used, gated, excluded = (verdict == v for v in (Verdict.USED, Verdict.GATED, Verdict.EXCLUDED))
        weighed = (used | gated | excluded) & (reports["dof"] > 0)
        refused = ~(used | gated | excluded | (verdict == Verdict.HELD))
        columns = [
            np.where(gated, nis, np.nan),
            np.where(excluded, nis, np.nan),
            np.where(refused, 0.0, np.nan),
        ]
        self.marks.add(t_ns, np.stack(columns, axis=1))
        self._innovations(t_ns[weighed], reports[weighed])
        limit = np.where(np.isfinite(reports["limit"]) & (reports["limit"] > 0), reports["limit"], np.nan)
        self.nis.add(t_ns[weighed], np.stack([np.where(used, nis, np.nan), limit], axis=1)[weighed])

    def _innovations(self, t_ns: NDArray[np.int64], reports: NDArray[Any]) -> None:
        if not len(reports):
            return
        m = self._most
        self._measured = max(self._measured, min(m, int(reports["dof"].max())))
        has = np.arange(m) < reports["dof"][:, None]
        declared = reports["R_declared"][:, :m]
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.where(declared > 0, reports["R_used"][:, :m] / declared, np.nan)
            sigma = BAND * np.sqrt(reports["S"][:, :m])
        nu, used = reports["nu"][:, :m], (reports["verdict"] == Verdict.USED)[:, None]
        self.nu.add(t_ns, np.where(has & used, nu, np.nan))
        self.missed.add(t_ns, np.where(has & ~used, nu, np.nan))
        self.sigma.add(t_ns, np.where(has, sigma, np.nan))
        self.ratio.add(t_ns, np.where(has, ratio, np.nan))


class InputTrace:
    """What a sensor measured that drives the prediction; used readings alone."""

    def __init__(self, sensor: SensorLayout, envelope: NewEnvelope, layout: Layout) -> None:
        self.sensor = sensor
        self.channels = sensor.channels[: layout.shape.payload]
        self.z = envelope(len(self.channels))

    def add(self, t_ns: NDArray[np.int64], reports: NDArray[Any]) -> None:
        """Take this sensor's reports."""
        used = reports["verdict"] == Verdict.USED
        self.z.add(t_ns[used], reports["z"][used][:, : len(self.channels)])


class HealthTrace:
    """Health of every sensor, as its place in SEVERITY, and last that of the service."""

    def __init__(self, layout: Layout, envelope: NewEnvelope) -> None:
        self._sensors = len(layout.sensors)
        self.levels = envelope(self._sensors + 1)
        self.final: NDArray[np.int32] = np.zeros(max(1, self._sensors), np.int32)
        self.service = ServiceHealth.NOMINAL
        self._severity = np.zeros(len(Health), np.int64)
        for place, health in enumerate(SEVERITY):
            self._severity[health] = place

    def add(self, t_ns: NDArray[np.int64], reports: NDArray[Any]) -> None:
        """Take a block."""
        sensors = self._severity[reports["health"][:, : self._sensors]]
        self.levels.add(t_ns, np.column_stack([sensors, reports["service"]]))
        self.final = reports["health"][-1].copy()
        self.service = ServiceHealth(int(reports["service"][-1]))

    def stretches(self, column: int, end_s: float) -> list[tuple[float, float, int]]:
        """Start and end, s since the origin, and level: what one lane is made of; quiet intervals keep the last."""
        bins = self.levels.filled()
        worst, last = (a[bins, column].astype(np.int64) for a in (self.levels.high, self.levels.last))
        width_s = self.levels.width_ns / 1e9
        out: list[tuple[float, float, int]] = []
        for k, at in enumerate(bins):
            start = float(at * width_s)
            stop = float(bins[k + 1] * width_s) if k + 1 < len(bins) else end_s
            pieces = [
                (start, min(start + width_s, stop), int(worst[k])),
                (start + width_s, stop, int(last[k])),
            ]
            for a, b, level in pieces:
                if b <= a:
                    continue
                if out and out[-1][2] == level:
                    out[-1] = (out[-1][0], b, level)
                else:
                    out.append((a, b, level))
        return out


class CommandTrace:
    """Commands that were due and valid."""

    def __init__(self, layout: Layout, envelope: NewEnvelope) -> None:
        self.slots = layout.controls
        self.values = envelope(max(1, len(self.slots)))

    def add(self, t_ns: NDArray[np.int64], reports: NDArray[Any]) -> None:
        """Take a block."""
        due = (reports["command_due"] == 1) & (reports["command_valid"] == 1)
        self.values.add(t_ns[due], reports["command"][due])
