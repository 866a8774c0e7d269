"""What is measured on the recordings that the strapdown filter runs: jackal_3d, px4_iris and comma2k19."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from tools.pages.recorded import Floats, Recorded, errors, rms_length
from tools.pages.recording_rows import Row, changed

PUBLISHED_M = np.array([1.0206, 3.4292, 0.7419])
ALLOWED_M = 0.1383
SETTLED_S = 5.0
IRIS_REACH = (0.3, 0.2)
"""m and m/s RMS, all three axes together: as near as two sound filters are."""
PHONE_BIAS_RAD_S = np.array([-0.00978088, -0.03511047, 0.06835938])
"""What the phone itself had worked out, by axis."""
BIAS_REACH_RAD_S = 0.002
HIGHWAY_REACH_M, FIXES_M = 0.6, 0.55
"""What is asked of the estimate, and how far the fixes are from the pose with their delay taken off."""
GNSS = ("gnss_position", "gnss_course")


def jackal_3d_rows(run: Recorded) -> list[Row]:
    """The end in all three axes."""
    last = run.reports[-1]
    apart = last["x"][:3] - PUBLISHED_M
    number = run.assembly.layout.numbers["orientation"]
    blind = run.run(lambda chunk: chunk["sensor"] != number).final["state"]
    lost = np.array([blind[name] for name in "xyz"]) - PUBLISHED_M
    return [
        Row("end, distance from the published one, all axes", float(np.linalg.norm(apart)), ALLOWED_M, digits=4),
        Row("of it, height", abs(float(apart[2])), None, digits=4),
        Row("its own standard deviation, all three axes", float(np.linalg.norm(last["std"][:3])), None, digits=4),
        Row("without the IMU's own attitude", float(np.linalg.norm(lost)), None, digits=2),
    ]  # fmt: skip


def iris_rows(run: Recorded) -> list[Row]:
    """Distance from the other filter's answer."""
    position = errors(run, run.reports, ["x", "y", "z"], SETTLED_S)[1]
    velocity = errors(run, run.reports, ["vx", "vy", "vz"], SETTLED_S)[1]
    fixes = [run.assembly.layout.numbers[name] for name in ("gnss_position", "gnss_velocity")]
    kept = run.assembly.engine().process(run.readings[~np.isin(run.readings["sensor"], fixes)])
    lost = errors(run, kept, ["x", "y"], SETTLED_S)[1]
    return [
        Row("position, RMS from the reference after 5 s", rms_length(position), IRIS_REACH[0], digits=3),
        Row(
            "velocity, RMS from the reference after 5 s", rms_length(velocity), IRIS_REACH[1], None, "m/s", 3
        ),
        Row("height alone", rms_length(position[:, 2:]), None, digits=3),
        Row("without GNSS: horizontal position", rms_length(lost), None, digits=2),
    ]


def delayed(run: Recorded, delay_s: float) -> Recorded:
    """The highway with another delay of the receiver's stamps."""
    sections: dict[str, dict[str, Any]] = {f"sensor.{name}": {"delay_s": delay_s} for name in GNSS}
    return dataclasses.replace(run, assembly=changed(run.assembly, sections))


def bias_errors(run: Recorded) -> Floats:
    """(k, 3) gyro bias as estimated after each reading, minus the phone's own, rad/s."""
    return np.asarray(run.reports["x"][:, 6:9] - PHONE_BIAS_RAD_S)


def settled_s(run: Recorded) -> float:
    """When the last of the three biases comes within reach for good, s since the first reading."""
    outside = np.flatnonzero(np.abs(bias_errors(run)).max(axis=1) > BIAS_REACH_RAD_S)
    return float(run.t_s[outside[-1]]) if len(outside) else 0.0


def highway_rows(run: Recorded) -> list[Row]:
    """Gyro bias, position, and what the delay of the fixes costs."""
    last, std = np.abs(bias_errors(run)[-1]), run.reports["std"][-1, 6:9]
    rows = [
        Row(f"gyro bias {axis}, distance from the phone's own", 1e3 * last[k], 1e3 * BIAS_REACH_RAD_S, None, "mrad/s")
        for k, axis in enumerate("xyz")
    ]  # fmt: skip
    summary = run.run()
    assert summary.nees_mean is not None
    return [
        *rows,
        Row("the largest of their standard deviations", 1e3 * float(std.max()), None, None, "mrad/s"),
        Row("all three within reach for good after", settled_s(run), None, None, "s", 1),
        Row("horizontal position, RMS from the pose", rms_of(run), HIGHWAY_REACH_M, FIXES_M, digits=3),
        Row("mean NEES of x and y", summary.nees_mean, None, float(summary.nees_dof), ""),
        Row("the same without the delay: RMS from the pose", rms_of(delayed(run, 0.0)), None, 1.47, digits=3),
    ]


def rms_of(run: Recorded) -> float:
    """Horizontal RMS from the truth, m."""
    return rms_length(errors(run, run.reports, ["x", "y"])[1])


def delays(run: Recorded) -> str:
    """What another delay would make of it."""
    lines = ["| delay configured | RMS from the pose | mean, north | mean, east |", "|---|---|---|---|"]
    for delay_s in (0.0, 0.05, 0.08, 0.10, 0.12, 0.15, 0.20):
        other = delayed(run, delay_s)
        apart = errors(other, other.reports, ["x", "y"])[1]
        north, east = apart.mean(axis=0)
        lines.append(f"| {delay_s:.2f} s | {rms_length(apart):.2f} m | {north:+.2f} m | {east:+.2f} m |")
    return "\n".join(lines)
