"""The time line of a report: one lane for the service and for each sensor, coloured by health, faults by number."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from fusiond.cli.report_svg import HEALTH, LIGHT, SERVICE, WIDTH
from fusiond.recording.fault_words import FaultObject, fault_text
from fusiond.recording.report_run import RunReport
from fusiond.recording.report_traces import SEVERITY
from fusiond.types import Role, ServiceHealth

if TYPE_CHECKING:
    from fusiond.cli.report_pictures import Pictures

LEGEND = "healthy", "probation", "suspect", "faulty", "silent", "excluded"
LETTER_SHARE = 0.0085
"""Of the width, for one letter of a fault's words; where the faults beside it leave less its number stands alone."""
NEAR_SHARE = 0.03
"""Onsets nearer to each other than this share of the width have one label."""
MARKED = 100
"""Most faults marked on one lane."""


def shown_sensors(run: RunReport) -> list[int]:
    """Numbers of sensors with a lane: those whose readings make the estimate, and others that were heard."""
    summaries = run.summaries()
    making = (Role.UPDATE, Role.INPUT)
    return [s.number for s in run.layout.sensors if s.role in making or summaries[s.name].verdicts]


def numbered(run: RunReport) -> list[tuple[str, FaultObject]]:
    """Every fault with its sensor, by onset: the first is number 1, in picture and table."""
    found = [(name, fault) for name, summary in run.summaries().items() for fault in summary.faults]
    return sorted(found, key=lambda entry: (entry[1]["onset_s"], entry[0]))


def lanes(pictures: Pictures) -> Figure:
    """The picture; to be drawn within its look."""
    run = pictures.run
    sensors = shown_sensors(run)
    figure = Figure((WIDTH, 0.62 * (len(sensors) + 1) + 0.85), layout="constrained")
    axes = figure.subplots()
    levels = run.health.levels.low.shape[1]
    names = ["service", *(run.layout.sensors[number].name for number in sensors)]
    for place, column in enumerate([levels - 1, *sensors]):
        _lane(axes, pictures, place, column)
    faults = [(k + 1, name, fault) for k, (name, fault) in enumerate(numbered(run))]
    for place, name in enumerate(names):
        _marks(axes, pictures, place, [(k, fault) for k, of, fault in faults if of == name and place])
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.5, -0.75)
    axes.set_xlim(pictures.shift_s, pictures.end_s)
    axes.set_xlabel(pictures.time_label)
    axes.tick_params(axis="y", length=0)
    axes.spines["left"].set_visible(False)
    axes.grid(axis="y", visible=False)
    figure.legend(
        handles=[Patch(color=LIGHT[word], label=word) for word in LEGEND],
        loc="outside upper left",
        ncols=len(LEGEND),
    )
    return figure


def _lane(axes: Axes, pictures: Pictures, place: int, column: int) -> None:
    service = column == pictures.run.health.levels.low.shape[1] - 1
    length = pictures.end_s - pictures.shift_s
    for start, stop, level in pictures.run.health.stretches(column, length):
        state = ServiceHealth(level) if service else SEVERITY[level]
        colour = SERVICE[ServiceHealth(level)] if service else HEALTH[SEVERITY[level]]
        a, b = start + pictures.shift_s, stop + pictures.shift_s
        axes.barh(place, b - a, left=a, height=0.34, color=colour, linewidth=0)
        if stop - start > 0.012 * length * len(state.label):
            word = state.label.replace("_", " ")
            ink = "#ffffff" if colour == LIGHT["excluded"] else "#161616"
            axes.text((a + b) / 2, place, word, ha="center", va="center_baseline", color=ink, fontsize=7.5)


def _marks(axes: Axes, pictures: Pictures, place: int, faults: Sequence[tuple[int, FaultObject]]) -> None:
    span = pictures.end_s - pictures.shift_s
    groups: list[list[tuple[int, FaultObject]]] = []
    for number, fault in faults[:MARKED]:
        onset, found = pictures.at(fault["onset_s"]), pictures.at(fault["detected_s"])
        axes.plot([onset], [place - 0.26], "v", color=LIGHT["ink"], markersize=4.5, clip_on=False)
        axes.plot([found, found], [place - 0.19, place + 0.19], color=LIGHT["ink"], linewidth=1.0)
        if groups and fault["onset_s"] - groups[-1][-1][1]["onset_s"] < NEAR_SHARE * span:
            groups[-1].append((number, fault))
        else:
            groups.append([(number, fault)])
    for k, group in enumerate(groups):
        first, last = (pictures.at(group[end][1]["onset_s"]) for end in (0, -1))
        after = pictures.at(groups[k + 1][0][1]["onset_s"]) if k + 1 < len(groups) else pictures.end_s
        before = pictures.at(groups[k - 1][-1][1]["onset_s"]) if k else pictures.shift_s
        words = ", ".join(str(number) for number, _ in group)
        left = after - last < NEAR_SHARE * span
        said = f"{words}  {short(group[0][1])}"
        needed = LETTER_SHARE * span * len(said)
        if len(group) == 1 and max(after - last, first - before) > needed:
            left = after - last <= needed
            words = said
        label = axes.text(
            first - 0.008 * span if left else last + 0.008 * span, place - 0.3, words, fontsize=8,
            ha="right" if left else "left", va="center_baseline",
        )  # fmt: skip
        # Every picture has the same times in the same place, whatever a label needs.
        label.set_in_layout(False)


def short(fault: FaultObject) -> str:
    """Its kind and size: the table has the rest."""
    return plain(fault).split(" since ")[0]


def plain(fault: FaultObject) -> str:
    """A fault in words."""
    return fault_text(fault).replace("+-", "\u00b1 ")
