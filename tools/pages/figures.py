"""How every picture of the pages looks: the same bytes for the same figures."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

LOOK: Any = {
    "font.size": 9.0, "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True,
    "grid.alpha": 0.25, "legend.frameon": False, "figure.facecolor": "white",
}  # fmt: skip


@contextmanager
def figure(path: Path, width: float, height: float) -> Iterator[Figure]:
    """A figure (inches), saved on leaving without a date and with identifiers that depend on its name alone."""
    with mpl.rc_context():
        mpl.rcParams.update(LOOK | {"svg.hashsalt": path.stem})
        drawn = Figure((width, height), layout="constrained")
        yield drawn
        drawn.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)
