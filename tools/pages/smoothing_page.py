"""Measure the smoother and write docs/smoothing.md with its picture.

    python -m tools.pages.smoothing_page [--data FOLDER] [--docs docs]

FOLDER holds the recordings (default: FUSIOND_DATA, else ../shared/data). Exit 0 done, 1 a band is left, 2 the
operator's mistake.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fusiond.simulation.registry import simulate
from tools.pages.figures import figure
from tools.pages.recorded import FOLDERS, Recorded, import_from, recorded
from tools.pages.recordings import parser
from tools.pages.smoothing import ONE_FILTER, smoothed_run, truth_at
from tools.pages.smoothing_rows import recordings_table, simulated_table
from tools.pages.trials import configured, records

PAGE = Path(__file__).with_name("smoothing_page.md")
FILTER, SMOOTHED, TRUTH = "#edae49", "#00798c", "#222222"
WALKERS = ("udacity_laser_radar", "udacity_laser_radar_robot")
SHOWN_S = 6.0


def picture(into: Path) -> None:
    """The mini car's first seconds: errors of velocity and of the accelerometer's bias, within three deviations."""
    assembly = configured("minicar", ONE_FILTER)
    simulation = simulate("minicar", 0, SHOWN_S)
    run = smoothed_run(assembly, records(assembly.layout, simulation.readings))
    t_s = run.states["state_t_ns"] * 1e-9
    truth = truth_at(assembly, simulation, run.states["state_t_ns"])
    with figure(into / "smoothing.svg", 9.0, 3.0) as drawn:
        for place, (at, unit, title) in zip(
            drawn.subplots(1, 2), ((1, "m/s", "velocity"), (2, "m/s²", "accelerometer's bias")), strict=True
        ):
            for name, x, P, color in (
                ("filter", run.filtered["x"], run.filtered_P, FILTER),
                ("smoothed", run.states["x"], run.states["P"], SMOOTHED),
            ):
                error, bound = x[:, at] - truth[:, at], 3.0 * np.sqrt(P[:, at, at])
                place.fill_between(t_s, -bound, bound, color=color, alpha=0.25, lw=0)
                place.plot(t_s, error, color=color, lw=1.2, label=f"{name}, 3 sigma")
            limit = 6.0 * float(np.median(np.sqrt(run.filtered_P[:, at, at])))
            place.axhline(0.0, color=TRUTH, lw=0.6)
            place.set(xlabel="time, s", ylabel=f"error, {unit}", ylim=(-limit, limit), title=title)
            place.legend(loc="upper right")


def recordings(data: Path, into: Path) -> dict[str, Recorded]:
    """The recordings of the page, by configuration."""
    log = import_from(data / "udacity_laser_radar", "udacity_laser_radar", into)
    runs = {name: recorded(name, log) for name in WALKERS}
    iris = import_from(data / FOLDERS.get("px4_iris", "px4_iris"), "px4_iris", into)
    return runs | {"px4_iris": recorded("px4_iris", iris)}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, measure, draw, write."""
    given = parser().parse_args(arguments)
    if not given.data.is_dir():
        print(f"{given.data}: no such folder; say where the recordings are with --data", file=sys.stderr)
        return 2
    page = PAGE.read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        runs = recordings(given.data, Path(folder))
        table = recordings_table(((name, runs[name]) for name in WALKERS), runs["px4_iris"])
    page = page.replace("{{recordings}}", table).replace("{{simulated}}", simulated_table())
    (given.docs / "pictures").mkdir(parents=True, exist_ok=True)
    picture(given.docs / "pictures")
    (given.docs / "smoothing.md").write_text(page, encoding="utf-8")
    return 1 if "**no**" in page else 0


if __name__ == "__main__":
    sys.exit(main())
