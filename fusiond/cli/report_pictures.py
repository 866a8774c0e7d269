"""The pictures of a report: a time line of faults, the states, every sensor, the inputs and the commands."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from fusiond.cli.report_lanes import lanes
from fusiond.cli.report_svg import LIGHT, look, mosaic, panels, svg
from fusiond.recording.fault_words import FaultObject
from fusiond.recording.report_envelope import Envelope
from fusiond.recording.report_run import RunReport
from fusiond.recording.report_traces import InputTrace, SensorTrace
from fusiond.recording.truth import wrapped
from fusiond.types import NANOSECONDS, Slot, seconds

Floats = NDArray[np.float64]
SILENCE = 5.0
"""A pause this many times longer than usual interrupts a curve."""
POWERS = str.maketrans("23", "\u00b2\u00b3")
SHADED = 200
"""Most faults shaded behind curves."""


class Pictures:
    """Every picture of one run, as SVG elements.

    Args:
        run: with at least one reading.
    """

    def __init__(self, run: RunReport) -> None:
        self.run = run
        origin_s = seconds(run.origin_ns)
        # Unix time has ten digits that say nothing beside a curve.
        self.shift_s = origin_s if abs(origin_s) < 1e5 else 0.0
        self.time_label = "t (s)" if self.shift_s or not origin_s else f"t - {origin_s:.3f} s"
        self.end_s = self.shift_s + max(run.duration_s, 1e-6)
        self.faults = {name: s.faults for name, s in run.summaries().items()}

    def at(self, t_s: float) -> float:
        """A time of the log as a place on the axes."""
        return t_s - seconds(self.run.origin_ns) + self.shift_s

    def time_line(self) -> str:
        """Health of the service and of every sensor that was heard or should have been, faults by number."""
        with look("time_line"):
            return svg(
                lanes(self), "time_line", "Health of the service and of every sensor over time, with faults"
            )

    def states(self) -> str:
        """Every state with its band, and its error or the band's width beside it."""
        trace = self.run.states
        with look("states"):
            figure, axes = panels(len(trace.slots), 2, 1.55)
            for k, slot in enumerate(trace.slots):
                left, right = axes[k]
                self._state(left, k)
                left.set_ylabel(unit_of(slot))
                left.set_title(slot.name)
                self._certainty(right, k, slot)
                for panel in (left, right):
                    self._shade(panel, [f for faults in self.faults.values() for f in faults])
            self._times(axes)
            return svg(figure, "states", "Every state over time with its band of three standard deviations")

    def sensor(self, trace: SensorTrace, name: str) -> str:
        """Innovations, NIS and noise of one sensor; `name` of the picture, unique."""
        channels = trace.channels
        with look(name):
            rows = [[f"nu{k}", f"R{k}"] for k in range(len(channels))]
            figure, by_name = mosaic([*rows, ["nis", "nis"]], 1.6)
            for k, slot in enumerate(channels):
                self._innovation(by_name[f"nu{k}"], trace, k, slot)
                self._noise(by_name[f"R{k}"], trace, k, slot)
            self._nis(by_name["nis"], trace)
            for panel in by_name.values():
                self._shade(panel, self.faults[trace.sensor.name])
            self._times([[by_name["nis"]]])
            return svg(
                figure, name, f"Innovations, noise and normalised innovations squared of {trace.sensor.name}"
            )

    def input(self, trace: InputTrace, name: str) -> str:
        """What a sensor measured that drives the prediction."""
        with look(name):
            figure, axes = panels(len(trace.channels), 1, 1.55)
            for k, slot in enumerate(trace.channels):
                curve(axes[k][0], self, trace.z, k)
                axes[k][0].set_title(f"{slot.name}, measured")
                axes[k][0].set_ylabel(unit_of(slot))
                self._shade(axes[k][0], self.faults[trace.sensor.name])
            self._times(axes)
            return svg(figure, name, f"Readings of {trace.sensor.name}")

    def commands(self) -> str:
        """Every number of the command."""
        trace = self.run.commands
        with look("commands"):
            figure, axes = panels(len(trace.slots), 1, 1.55)
            for k, slot in enumerate(trace.slots):
                curve(axes[k][0], self, trace.values, k)
                axes[k][0].set_title(slot.name)
                axes[k][0].set_ylabel(unit_of(slot))
            self._times(axes)
            return svg(figure, "commands", "Commands over time")

    def _state(self, panel: Axes, k: int) -> None:
        lines, truth = self.run.states.lines, self.run.truth
        bins = lines.filled()
        t_s = lines.t_s(bins) + self.shift_s
        low, high = lines.low[bins, 3 * k + 1], lines.high[bins, 3 * k + 2]
        panel.fill_between(t_s, low, high, color=LIGHT["line"], alpha=0.2, linewidth=0, label="3 sigma")
        curve(panel, self, lines, 3 * k, label="estimate")
        shown = [lines.low[bins, 3 * k], lines.high[bins, 3 * k]]
        name = self.run.states.slots[k].name
        if truth is not None and name in truth.names:
            known, covered = truth.at(self.run.origin_ns + (NANOSECONDS * lines.t_s(bins)).astype(np.int64))
            at = truth.names.index(name)
            values = np.where(covered, known[:, at], np.nan)
            if truth.angles[at]:
                beside = lines.last[bins, 3 * k]
                values = beside - wrapped(beside - values)
            panel.plot(t_s, values, color=LIGHT["truth"], linestyle="--", label="truth")
            shown.append(values)
        settled = slice(len(bins) // 20, None)
        focus(panel, [*shown, low[settled], high[settled]])
        if k == 0:
            above(panel)

    def _certainty(self, panel: Axes, k: int, slot: Slot) -> None:
        states, truth = self.run.states, self.run.truth
        bins = states.widths.filled()
        t_s, width = states.widths.t_s(bins) + self.shift_s, states.widths.high[bins, k]
        if truth is not None and states.errors is not None and slot.name in truth.names:
            at = truth.names.index(slot.name)
            panel.fill_between(t_s, -width, width, color=LIGHT["line"], alpha=0.2, linewidth=0)
            curve(panel, self, states.errors, at, colour="truth")
            there = states.errors.filled()
            # The first moments may know nothing: the rest would be a flat line beside them.
            settled = slice(len(there) // 20, None)
            focus(panel, [states.errors.low[there, at][settled], states.errors.high[there, at][settled],
                          width[len(bins) // 10 :], -width[len(bins) // 10 :]])  # fmt: skip
            share = states.inside().get(slot.name)
            told = "" if share is None else f", {100 * share:.1f} % within 3 sigma"
            panel.set_title(f"error{told}")
            panel.set_ylabel(unit_of(slot))
        elif np.any(width > 0):
            low = states.widths.low[bins, k]
            panel.fill_between(t_s, low, width, color=LIGHT["line"], alpha=0.25, linewidth=0)
            panel.plot(t_s, width, color=LIGHT["line"])
            panel.set_yscale("log")
            panel.set_title("3 sigma")
            panel.set_ylabel(unit_of(slot))
        else:
            panel.set_title("no standard deviation of its own")
            panel.set_yticks([])

    def _innovation(self, panel: Axes, trace: SensorTrace, k: int, slot: Slot) -> None:
        bins = trace.sigma.filled()
        t_s, width = trace.sigma.t_s(bins) + self.shift_s, trace.sigma.high[bins, k]
        panel.fill_between(t_s, -width, width, color=LIGHT["line"], alpha=0.2, linewidth=0)
        curve(panel, self, trace.nu, k)
        focus(panel, [trace.nu.low[:, k], trace.nu.high[:, k], *usual(width)])
        low, high = panel.get_ylim()
        there = trace.missed.filled()
        there = there[np.isfinite(trace.missed.low[there, k])]
        for values in (trace.missed.low[there, k], trace.missed.high[there, k]) if len(there) else ():
            at_s = trace.missed.t_s(there) + self.shift_s
            # What is far away is marked at the edge: to scale it would hide the rest.
            panel.plot(
                at_s, np.clip(values, low, high), "v", color=LIGHT["faulty"], markersize=4, clip_on=False
            )
        panel.set_title(f"{slot.name}: innovation and 3 sigma")
        panel.set_ylabel(unit_of(slot))

    def _noise(self, panel: Axes, trace: SensorTrace, k: int, slot: Slot) -> None:
        curve(panel, self, trace.ratio, k)
        panel.axhline(1.0, color=LIGHT["limit"], linestyle="--", linewidth=0.8)
        bins = trace.ratio.filled()
        values = np.concatenate([trace.ratio.low[bins, k], trace.ratio.high[bins, k]])
        values = values[np.isfinite(values) & (values > 0)]
        if len(values):
            panel.set_yscale("log", base=2)
            panel.set_ylim(min(0.5, float(values.min()) / 1.2), max(2.0, float(values.max()) * 1.2))
            panel.yaxis.set_major_formatter("{x:g}")
        panel.set_title(f"{slot.name}: R used / R declared")

    def _nis(self, panel: Axes, trace: SensorTrace) -> None:
        curve(panel, self, trace.nis, 0, label="used")
        bins = trace.nis.filled()
        limit = trace.nis.low[bins, 1]
        if np.isfinite(limit).any():
            t_s = trace.nis.t_s(bins) + self.shift_s
            panel.plot(t_s, limit, color=LIGHT["limit"], linestyle="--", label="limit")
        there = trace.marks.filled()
        t_s = trace.marks.t_s(there) + self.shift_s
        for column, (word, role, shape) in enumerate(
            (("gated", "faulty", "v"), ("excluded", "excluded", "x"), ("refused", "ink", "|"))
        ):
            values = trace.marks.high[there, column]
            has = np.isfinite(values)
            if has.any():
                base = np.zeros_like(values) if column == 2 else values
                panel.plot(
                    t_s[has], base[has], shape, color=LIGHT[role], markersize=4.5, label=word, clip_on=False
                )
        panel.set_yscale("symlog", linthresh=10.0, linscale=1.5)
        panel.set_ylim(bottom=0.0)
        panel.yaxis.set_major_formatter("{x:g}")
        panel.set_title("NIS, the squared distance of a reading from its prediction")
        above(panel)

    def _shade(self, panel: Axes, faults: Sequence[FaultObject]) -> None:
        for fault in faults[:SHADED]:
            stop = self.end_s if fault["cleared_s"] is None else self.at(fault["cleared_s"])
            panel.axvspan(self.at(fault["onset_s"]), stop, color=LIGHT["faulty"], alpha=0.09, linewidth=0)

    def _times(self, axes: Sequence[Sequence[Axes]]) -> None:
        for panel in axes[-1]:
            panel.set_xlim(self.shift_s, self.end_s)
            panel.set_xlabel(self.time_label)


def curve(
    panel: Axes, pictures: Pictures, envelope: Envelope, column: int, *, colour: str = "line", label: str = ""
) -> None:
    """One column as a line through the smallest and the largest value of each interval, interrupted by silences."""
    bins = envelope.filled()
    bins = bins[np.isfinite(envelope.low[bins, column])]
    steps = np.diff(bins, prepend=bins[:1])
    # A silence is no straight line.
    silent = steps > SILENCE * np.median(steps[1:]) if len(bins) > 1 else np.zeros(len(bins), np.bool_)
    low = np.where(silent, np.nan, envelope.low[bins, column])
    t_s = np.repeat(envelope.t_s(bins) + pictures.shift_s, 3)
    values = np.stack([low, envelope.low[bins, column], envelope.high[bins, column]], axis=1).ravel()
    panel.plot(t_s, values, color=LIGHT[colour], label=label or None, solid_capstyle="round")


def above(panel: Axes) -> None:
    """A legend beside the title, where it hides nothing."""
    panel.legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=5, borderaxespad=0.0)


def focus(panel: Axes, shown: Sequence[Floats]) -> None:
    """Limits of the vertical axis to what shall be seen; a band that starts out wide is cut."""
    values = np.concatenate([np.ravel(part) for part in shown])
    values = values[np.isfinite(values)]
    if len(values):
        low, high = float(values.min()), float(values.max())
        margin = 0.06 * (high - low) or 0.1 * abs(high) or 1.0
        panel.set_ylim(low - margin, high + margin)


def usual(width: Floats) -> tuple[Floats, Floats]:
    """Both ends of a band but for its widest twentieth, which a start or a silence makes."""
    known = width[np.isfinite(width)]
    kept = known[known <= np.quantile(known, 0.95)] if len(known) else known
    return -kept, kept


def unit_of(slot: Slot) -> str:
    """A unit for an axis: `m/s\u00b2`, `N`."""
    return "N" if slot.unit == "n" else slot.unit.replace("_", "/").translate(POWERS)
