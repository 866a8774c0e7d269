"""Pictures of the recordings, as SVG with the same bytes at every run. Needs matplotlib."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.patches import Ellipse

from tools.pages.figures import figure
from tools.pages.recorded import Floats, Recorded
from tools.pages.recording_rows import OUTAGES_S, PUBLISHED_M

ESTIMATE, MEASURED, TRUTH, OTHER, LOST = "#00798c", "#edae49", "#222222", "#8d6a9f", "#d1495b"


def jackal(run: Recorded, path: Path) -> None:
    """The way, its end beside the published one with the filter's own 3-sigma, and the growing uncertainty."""
    states, std = run.reports["x"][::10], run.reports["std"][::10]
    with figure(path, 9.0, 3.2) as drawn:
        way, end, growth = drawn.subplots(1, 3)
        way.plot(states[:, 0], states[:, 1], color=ESTIMATE, lw=1.2)
        way.plot(*PUBLISHED_M, "x", color=LOST)
        way.set(xlabel="x, m", ylabel="y, m", title="jackal: 84 m by wheels and IMU", aspect="equal")
        last = run.reports[-1]
        deviation = 3.0 * last["std"][:2]
        end.add_patch(Ellipse(last["x"][:2], *(2.0 * deviation), color=ESTIMATE, alpha=0.15, lw=0))
        end.plot(*last["x"][:2], "o", color=ESTIMATE, label="estimate, 3 sigma")
        end.plot(*PUBLISHED_M, "x", color=LOST, label="published")
        end.set(
            xlim=last["x"][0] + np.array([-0.15, 0.15]), ylim=last["x"][1] + np.array([-0.15, 0.15]),
            xlabel="x, m", title="its end", aspect="equal",
        )  # fmt: skip
        end.legend(loc="upper right")
        growth.plot(run.t_s[::10], np.hypot(std[:, 0], std[:, 1]), color=ESTIMATE)
        growth.set(
            xlabel="time, s", ylabel="std of the position, m", title="nothing measures it", ylim=(0, None)
        )


def withheld(run: Recorded, outage_s: tuple[float, float]) -> tuple[Floats, Floats]:
    """Positions (k, 2) of a run without fixes in the outage, inside it, and the fixes withheld."""
    gps = run.of("gps")
    inside = (run.t_s >= outage_s[0]) & (run.t_s < outage_s[1])
    kept = ~(gps & inside)
    reports = run.assembly.engine().process(run.readings[kept])
    return reports["x"][inside[kept]][:, :2].copy(), run.readings["z"][run.used("gps") & inside][:, :2]


def dresden(run: Recorded, path: Path) -> None:
    """The drive with its fixes, and the three outages."""
    fixes = run.readings["z"][run.used("gps")]
    states = run.reports["x"][::15]
    with figure(path, 9.0, 7.4) as drawn:
        places: Any = drawn.subplot_mosaic([["map", "map", "map"], ["a", "b", "c"]], height_ratios=[1.9, 1.0])
        whole = places["map"]
        whole.plot(fixes[:, 0], fixes[:, 1], ".", color=MEASURED, ms=3, label="new fixes")
        whole.plot(states[:, 0], states[:, 1], color=ESTIMATE, lw=1.1, label="estimate")
        whole.set(xlabel="east, m", ylabel="north, m", title="dresden_car", aspect="equal")
        for outage_s, place in zip(OUTAGES_S, "abc", strict=True):
            estimated, lost = withheld(run, outage_s)
            part = places[place]
            part.plot(lost[:, 0], lost[:, 1], ".", color=LOST, ms=3, label="fixes withheld")
            part.plot(estimated[:, 0], estimated[:, 1], color=ESTIMATE, lw=1.1)
            part.set(
                title="no fix from {:.0f} s to {:.0f} s".format(*outage_s), xlabel="east, m", aspect="equal"
            )
            part.set_adjustable("datalim")
        whole.plot([], [], ".", color=LOST, label="fixes withheld, below")
        whole.legend(loc="upper left")
        places["a"].set_ylabel("north, m")


def clock(run: Recorded, path: Path) -> None:
    """How late rows were written, and how far the estimate is from the fixes."""
    gps, used = run.of("gps"), run.used("gps")
    rows = run.readings[gps]
    behind_s = (rows["arrival_ns"] - rows["t_ns"]) / 1e9
    apart = run.reports["x"][used, :2] - run.readings["z"][used, :2]
    with figure(path, 9.0, 3.6) as drawn:
        above, below = drawn.subplots(2, 1, sharex=True)
        above.plot(run.t_s[gps][::5], behind_s[::5], color=OTHER, lw=0.9)
        above.set(ylabel="written late by, s", title="dresden_car: the logger stalls at 97 s")
        below.plot(run.t_s[used], np.hypot(apart[:, 0], apart[:, 1]), color=ESTIMATE, lw=0.9)
        below.set(xlabel="time, s", ylabel="estimate from fix, m", xlim=(0, 216), ylim=(0, None))


def udacity(point: Recorded, robot: Recorded, path: Path) -> None:
    """The way with what the laser saw, and both models' errors of position and velocity."""
    truth = point.truth
    assert truth is not None
    true, _ = truth.at(point.readings["t_ns"])
    seen = point.readings["z"][point.of("laser")]
    speeds = [robot.assembly.engine().outputs(x) for x in robot.reports["x"]]
    velocity = np.array([[one["vx"], one["vy"]] for one in speeds])
    with figure(path, 9.0, 6.2) as drawn:
        places: Any = drawn.subplot_mosaic([["map", "map"], ["position", "velocity"]])
        places["map"].plot(seen[:, 0], seen[:, 1], ".", color=MEASURED, ms=3, label="laser")
        places["map"].plot(true[:, 0], true[:, 1], color=TRUTH, lw=1.0, label="truth")
        states = robot.reports["x"]
        places["map"].plot(states[:, 0], states[:, 1], color=ESTIMATE, lw=1.0, label="planar robot")
        places["map"].set(title="udacity_laser_radar", xlabel="x, m", ylabel="y, m")
        places["map"].legend(loc="lower right")
        pairs = [
            ("constant velocity", OTHER, point.reports["x"][:, :2], point.reports["x"][:, 2:4]),
            ("planar robot", ESTIMATE, states[:, :2], velocity),
        ]
        for name, colour, place, speed in pairs:
            off = np.hypot(*(place - true[:, :2]).T)
            places["position"].plot(point.t_s, off, color=colour, lw=0.9, label=name)
            off = np.hypot(*(speed - true[:, 2:4]).T)
            places["velocity"].plot(point.t_s, off, color=colour, lw=0.9)
        places["position"].set(xlabel="time, s", ylabel="error of position, m", ylim=(0, 0.4))
        places["velocity"].set(xlabel="time, s", ylabel="error of velocity, m/s", ylim=(0, 2.0))
        places["position"].legend(loc="upper right")
