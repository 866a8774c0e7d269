"""How every picture of a report looks, and how it becomes part of a page: colours of the page, nothing from elsewhere.

Pictures are drawn in the colours of light paper. In the page each of them is a variable of its style sheet, so that the
same picture is readable on dark ground.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fusiond.types import Health, ServiceHealth

LIGHT = {
    "ink": "#1b1f24", "line": "#1f5fbf", "truth": "#d9480e", "limit": "#868e97", "healthy": "#37a169",
    "probation": "#4c8df6", "suspect": "#e9b306", "faulty": "#e8590d", "excluded": "#c2255d", "silent": "#868e96",
}  # fmt: skip
DARK = {
    "ink": "#e3e8ee", "line": "#6ea8fe", "truth": "#ff9a5c", "limit": "#9aa5b1", "healthy": "#3fb67a",
    "probation": "#6ea0ff", "suspect": "#f2c744", "faulty": "#ff7b39", "excluded": "#ef4f87", "silent": "#8d97a3",
}  # fmt: skip
"""Colours by role; the light ones differ from each other, as each is found again in the picture."""

HEALTH = {health: LIGHT[health.label] for health in Health}
SERVICE = {
    ServiceHealth.NOMINAL: LIGHT["healthy"],
    ServiceHealth.DEGRADED: LIGHT["suspect"],
    ServiceHealth.DEAD_RECKONING: LIGHT["faulty"],
    ServiceHealth.INVALID: LIGHT["excluded"],
}
WIDTH = 9.6
"""Width of every picture, inches."""
LOOK: Any = {
    "font.size": 9.0, "axes.titlesize": 9.5, "axes.titlelocation": "left", "axes.spines.top": False,
    "axes.spines.right": False, "axes.grid": True, "grid.alpha": 0.18, "grid.color": LIGHT["ink"],
    "grid.linewidth": 0.6, "axes.linewidth": 0.7, "lines.linewidth": 1.0, "legend.frameon": False,
    "legend.fontsize": 8.5, "svg.fonttype": "none", "path.simplify": True, "axes.formatter.useoffset": False,
    "axes.axisbelow": True, "axes.xmargin": 0.0,
    **dict.fromkeys(("text.color", "axes.edgecolor", "axes.labelcolor", "xtick.color", "ytick.color"), LIGHT["ink"]),
}  # fmt: skip


@contextmanager
def look(name: str) -> Iterator[None]:
    """Within it figures get the report's look, and identifiers that depend on `name` alone."""
    with mpl.rc_context():
        mpl.rcParams.update(LOOK | {"svg.hashsalt": name})
        yield


def panels(rows: int, columns: int, height: float) -> tuple[Figure, list[list[Axes]]]:
    """A figure of rows by columns panels that share their times; `height` of a row, inches."""
    figure = Figure((WIDTH, rows * height + 0.35), layout="constrained")
    axes = figure.subplots(rows, columns, sharex=True, squeeze=False)
    return figure, [list(row) for row in axes]


def mosaic(rows: list[Any], height: float) -> tuple[Figure, dict[str, Axes]]:
    """A figure of named panels that share their times; a name in two columns is one wide panel.

    Args:
        rows: lists of names, equally long.      height: of a row, inches.
    """
    figure = Figure((WIDTH, len(rows) * height + 0.35), layout="constrained")
    axes: dict[str, Axes] = figure.subplot_mosaic(rows)
    last = axes[rows[-1][-1]]
    for panel in axes.values():
        if panel is not last:
            panel.sharex(last)
    return figure, axes


def svg(figure: Figure, name: str, alt: str) -> str:
    """The figure as an element of a page: named for who cannot see it, its identifiers its own.

    Args:
        name: of the picture, a word without spaces, unique on the page.      alt: what it shows, plain ASCII words.
    """
    out = io.StringIO()
    figure.savefig(out, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    text = out.getvalue()
    text = text[text.index("<svg") :].strip()
    text = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r' xmlns(:\w+)?="[^"]*"| width="[^"]*pt"| height="[^"]*pt"', "", text)
    text = text.replace("xlink:href", "href")
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r'(href="|url\()#', rf"\1#{name}-", text)
    text = re.sub(r' d="[^"]*"', _shorter, text, flags=re.DOTALL)
    text = re.sub(r' (?:x|y)="[^"]*"', _shorter, text)
    for role, colour in LIGHT.items():
        text = text.replace(colour, f"var(--{role})")
    return text.replace("<svg", f'<svg role="img" aria-label="{alt}"', 1)


def _shorter(found: re.Match[str]) -> str:
    """Coordinates to a hundredth of a point: more is not to be seen."""
    return re.sub(r"(\.\d\d)\d+", r"\1", found.group().replace("\n", ""))
