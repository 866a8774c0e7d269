"""Pictures of the strapdown filter on recordings, as SVG with the same bytes at every run. Needs matplotlib."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tools.pages.figures import figure
from tools.pages.recorded import Recorded, errors
from tools.pages.recording_pictures import ESTIMATE, LOST, MEASURED, OTHER, TRUTH
from tools.pages.recording_strapdown_rows import (
    BIAS_REACH_RAD_S,
    IRIS_REACH,
    PUBLISHED_M,
    SETTLED_S,
    bias_errors,
    delayed,
)

AXES = ((ESTIMATE, "x"), (LOST, "y"), (OTHER, "z"))


def jackal_3d(run: Recorded, path: Path) -> None:
    """Height over time with its 3 sigma and the published end, and the way seen from the side."""
    at = slice(None, None, 30)
    states, std, t_s = run.reports["x"][at], run.reports["std"][at], run.t_s[at]
    with figure(path, 9.0, 3.2) as drawn:
        height, side = drawn.subplots(1, 2)
        low, high = (states[:, 2] - 3.0 * std[:, 2]), (states[:, 2] + 3.0 * std[:, 2])
        height.fill_between(t_s, low, high, color=ESTIMATE, alpha=0.2, lw=0, label="3 sigma")
        height.plot(t_s, states[:, 2], color=ESTIMATE, lw=1.2, label="estimate")
        height.plot(run.t_s[-1], PUBLISHED_M[2], "x", color=LOST, label="published end")
        height.set(xlabel="time, s", ylabel="height, m", title="jackal_3d: over sloping ground")
        height.legend(loc="upper left")
        side.plot(states[:, 0], states[:, 2], color=ESTIMATE, lw=1.2)
        side.plot(PUBLISHED_M[0], PUBLISHED_M[2], "x", color=LOST)
        side.set(xlabel="x, m", ylabel="height, m", title="seen from the side")


def iris(run: Recorded, path: Path) -> None:
    """Height beside the reference's, and the distance from it in position and velocity."""
    truth = run.truth
    assert truth is not None
    begin_ns = run.readings["t_ns"].min()
    at = slice(None, None, 25)
    with figure(path, 9.0, 3.2) as drawn:
        height, position, velocity = drawn.subplots(1, 3)
        height.plot((truth.t_ns - begin_ns) / 1e9, -truth.values[:, 2], color=TRUTH, lw=2.4, label="EKF2")
        height.plot(run.t_s[at], -run.reports["x"][at, 2], color=ESTIMATE, lw=1.0, label="estimate")
        height.set(xlabel="time, s", ylabel="height, m", title="px4_iris")
        height.legend(loc="upper left")
        for part, names, reach, unit in (
            (position, ["x", "y", "z"], IRIS_REACH[0], "position, m"),
            (velocity, ["vx", "vy", "vz"], IRIS_REACH[1], "velocity, m/s"),
        ):
            t_s, apart = errors(run, run.reports, names)
            part.plot(t_s[::5], np.linalg.norm(apart[::5], axis=1), color=ESTIMATE, lw=0.9)
            part.plot([SETTLED_S, t_s[-1]], [reach, reach], "--", color=LOST, lw=0.9, label="asked for, RMS")
            part.set(xlabel="time, s", ylabel=f"distance in {unit}", ylim=(0, 2.5 * reach))
        position.legend(loc="upper left")


def highway(run: Recorded, path: Path) -> None:
    """How the gyro's bias is found, and how far from the pose estimates and fixes are."""
    apart = 1e3 * bias_errors(run)
    at = slice(None, None, 20)
    truth, fixes = run.truth, run.readings[run.of("gnss_position")]
    assert truth is not None
    true, covered = truth.at(fixes["t_ns"] - 100_000_000)
    off = np.hypot(*(fixes["z"][:, :2] - true).T)[covered]
    believed = delayed(run, 0.0)
    with figure(path, 9.0, 3.4) as drawn:
        bias, place = drawn.subplots(1, 2)
        reach = 1e3 * BIAS_REACH_RAD_S
        bias.axhspan(-reach, reach, color=MEASURED, alpha=0.25, lw=0)
        for k, (colour, axis) in enumerate(AXES):
            bias.plot(run.t_s[at], apart[at, k], color=colour, lw=1.0, label=axis)
        bias.set(
            xlabel="time, s",
            ylabel="from the phone's own, mrad/s",
            title="comma2k19: the gyro's bias",
            ylim=(-8, 8),
        )
        bias.legend(loc="upper right", ncols=3)
        for one, colour, name in ((believed, LOST, "stamps believed"), (run, ESTIMATE, "0.10 s taken off")):
            t_s, error = errors(one, one.reports, ["x", "y"])
            place.plot(t_s[::10], np.hypot(*error[::10].T), color=colour, lw=0.9, label=name)
        place.plot(
            run.t_s[run.of("gnss_position")][covered],
            off,
            ".",
            color=MEASURED,
            ms=2.5,
            label="fixes, 0.10 s taken off",
        )
        place.set(xlabel="time, s", ylabel="horizontal, from the pose, m", ylim=(0, 3.0), title="position")
        place.legend(loc="upper right")
