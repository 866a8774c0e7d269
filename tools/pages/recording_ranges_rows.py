"""What is measured on the mower: odometry and ranges to beacons, with the scale of the ranges as a state or without."""

from __future__ import annotations

import numpy as np

from fusiond.assembly.assembly import assemble
from tools.pages.recorded import Floats, Recorded, Records, errors, rms_length
from tools.pages.recording_rows import Row

SCALE, SCALE_REACH = 1.069, 0.003
RMSE_REACH_M = 0.45
REFERENCE_M = {"scaled": 0.404, "raw": 4.02, "odometry": 31.6}
"""A plain filter of three states, range sigma 0.6 m: ranges / 1.069, ranges as they come, no ranges at all."""
HEADINGS_RAD = (-3.0, -2.0, -1.0, 1.0, 2.0, 3.0)


def without_ranges(run: Recorded) -> Floats:
    """(rows, 2) errors of x and y by odometry alone, at its own stamps."""
    truth = run.truth
    assert truth is not None
    reports = run.assembly.engine().process(run.readings[run.of("odometry")])
    true, covered = truth.at(reports["state_t_ns"])
    return np.asarray((reports["x"][:, :2] - true[:, :2])[covered])


def turned(run: Recorded, by_rad: float) -> Records:
    """Reports of a run that starts with another heading, unknown within 1.8 rad."""
    config = run.assembly.config
    state, std = config.initial.state, config.initial.std
    initial = config.initial.model_copy(
        update={"state": state | {"yaw_rad": state["yaw_rad"] + by_rad}, "std": std | {"yaw_rad": 1.8}}
    )
    other = assemble(config.model_copy(update={"initial": initial}))
    return other.engine().process(run.readings).copy()


def ratios(run: Recorded) -> dict[int, float]:
    """What each beacon reads over the true distance to it, by least squares: truth, not the filter, is asked."""
    truth, config = run.truth, run.assembly.config.sensor["uwb"]
    assert truth is not None
    ranges = run.readings[run.of("uwb")]
    true, _ = truth.at(ranges["t_ns"])
    found = {}
    for number, x_m, y_m in config.beacons:  # type: ignore[attr-defined]
        at = ranges["z"][:, 1] == number
        distance = np.hypot(true[at, 0] - x_m, true[at, 1] - y_m)
        found[int(number)] = float(ranges["z"][at, 0] @ distance / (distance @ distance))
    return found


def mower_rows(scaled: Recorded, raw: Recorded) -> list[Row]:
    """Errors against the GPS, the scale, and what becomes of the rest."""
    summary, raw_summary = scaled.run(), raw.run()
    assert summary.nees_mean is not None
    at_rms = {
        name: rms_length(errors(run, run.reports, ["x", "y"])[1]) for name, run in (("s", scaled), ("r", raw))
    }
    scale, std = summary.final["state"]["range_scale"], summary.final["std"]["range_scale"]
    nis, raw_nis = summary.sensors["uwb"].nis_mean, raw_summary.sensors["uwb"].nis_mean
    assert nis is not None
    assert raw_nis is not None
    any_heading = [rms_length(errors(scaled, turned(scaled, by), ["x", "y"], 60.0)[1]) for by in HEADINGS_RAD]
    apart = list(ratios(scaled).values())
    return [
        Row(
            "scale a state: RMSE of the position", at_rms["s"], RMSE_REACH_M, REFERENCE_M["scaled"], digits=3
        ),
        Row("scale a state: found, distance from 1.069", abs(scale - SCALE), SCALE_REACH, unit="", digits=4),
        Row("scale a state: found", scale, None, float(np.mean(apart)), "", 4),
        Row("scale a state: its own standard deviation", std, None, unit="", digits=4),
        Row("scale a state: mean NIS of a range", nis, None, 1.0, ""),
        Row("scale a state: mean NEES", summary.nees_mean, None, float(summary.nees_dof), ""),
        Row("the same from any heading, after 60 s: worst RMSE", max(any_heading), RMSE_REACH_M, digits=3),
        Row("ranges as they come: RMSE of the position", at_rms["r"], None, REFERENCE_M["raw"]),
        Row("ranges as they come: mean NIS of a range", raw_nis, None, 1.0, ""),
        Row(
            "no ranges: RMSE of the position", rms_length(without_ranges(raw)), None, REFERENCE_M["odometry"]
        ),
    ]
