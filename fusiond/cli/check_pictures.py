"""Pictures of the fuzzy rules of adaptation: their sets, and the surface they make. Needs matplotlib."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from fusiond.adapt.fuzzy_design import CHANGE, MEAN, SCATTER, Rules
from fusiond.cli.report_svg import LIGHT, LOOK, WIDTH

TITLES = {
    "scatter": ("ln(mean square of the innovations / expected)", SCATTER),
    "mean": ("|mean of the innovations|, its own deviations", MEAN),
    "change": ("change of ln R in one reading, in steps", CHANGE),
}


def _save(figure: Figure, path: Path) -> Path:
    figure.savefig(path, metadata={"Date": None})
    return path


def draw_sets(rules: Rules, folder: Path) -> Path:
    """The trapezoids of both inputs and of the output."""
    with mpl.rc_context():
        mpl.rcParams.update(LOOK | {"svg.hashsalt": "sets"})
        figure = Figure((WIDTH, 6.0), layout="constrained")
        axes = figure.subplots(3, 1)
        for at, (kind, (title, span)) in zip(axes, TITLES.items(), strict=True):
            for label, corners in getattr(rules, kind).items():
                line = at.plot(corners, [0.0, 1.0, 1.0, 0.0], label=label)[0]
                at.text(0.5 * (corners[1] + corners[2]), 1.06, label, color=line.get_color(), ha="center")
            at.set_xlim(*span)
            at.set_ylim(0.0, 1.25)
            at.set_xlabel(title)
            at.set_ylabel("membership")
        return _save(figure, folder / "fuzzy_sets.svg")


def draw_surface(made: Any, folder: Path) -> Path:
    """The control surface of a design record's noise tables: the change of ln R over both inputs."""
    with mpl.rc_context():
        mpl.rcParams.update(LOOK | {"svg.hashsalt": "surface"})
        figure = Figure((WIDTH, 4.2), layout="constrained")
        at = figure.subplots()
        scatter, mean, table = made["row_at"], made["column_at"], made["table"]
        most = float(np.max(np.abs(table)))
        filled = at.contourf(scatter, mean, table.T, levels=np.linspace(-most, most, 21), cmap="RdBu_r")
        at.contour(scatter, mean, table.T, levels=[0.0], colors=[LIGHT["ink"]], linewidths=0.6)
        figure.colorbar(filled, label="change of ln R in one reading")
        at.set_xlabel(TITLES["scatter"][0])
        at.set_ylabel(TITLES["mean"][0])
        return _save(figure, folder / "fuzzy_surface.svg")
