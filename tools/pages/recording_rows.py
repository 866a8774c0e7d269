"""What is measured on the recordings, as rows of tables."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from fusiond.assembly.assembly import Assembly, assemble
from tools.pages import ctrv_reference
from tools.pages.ctrv_reference import Rows
from tools.pages.recorded import Recorded, fix_residuals_m, outage_m

PUBLISHED_M = (1.0206, 3.4292)
COURSE = {"x": 0.09, "y": 0.10, "vx": 0.40, "vy": 0.30}
REFERENCE = {"x": 0.0748, "y": 0.0743, "vx": 0.2898, "vy": 0.2495}
FIRST_COURSE_DEG = 324.2
"""Clockwise from north, in the first row of the drive."""
OUTAGES_S = {(60.0, 70.0): 3.9, (60.0, 90.0): 9.3, (100.0, 130.0): 9.5}


@dataclass(frozen=True, slots=True)
class Row:
    """One figure. `reach` is None where nothing is asked of it, `reference` where there is nothing to compare."""

    what: str
    measured: float
    reach: float | None
    reference: float | None = None
    unit: str = "m"
    digits: int = 2

    @property
    def ok(self) -> bool:
        """Whether it is reached."""
        return self.reach is None or self.measured <= self.reach


def table(rows: list[Row]) -> str:
    """Markdown."""
    lines = ["| what | measured | reach | reference |", "|---|---|---|---|"]
    for row in rows:
        unit = f" {row.unit}" if row.unit else ""
        reach = "" if row.reach is None else f"<= {row.reach:.4g}{unit}{'' if row.ok else ' **missed**'}"
        reference = "" if row.reference is None else f"{row.reference:.{row.digits}f}{unit}"
        lines.append(f"| {row.what} | {row.measured:.{row.digits}f}{unit} | {reach} | {reference} |")
    return "\n".join(lines)


def jackal_rows(run: Recorded) -> list[Row]:
    """Distance from the published end, and what is claimed about it."""
    final = run.run().final
    off_m = float(np.hypot(final["state"]["x"] - PUBLISHED_M[0], final["state"]["y"] - PUBLISHED_M[1]))
    std_m = float(np.hypot(final["std"]["x"], final["std"]["y"]))
    return [
        Row("end, horizontal distance from the published one", off_m, 0.05, digits=4),
        Row("the same, as the filter's own standard deviation has it", std_m, None, digits=4),
    ]


def udacity_rows(point: Recorded, robot: Recorded) -> list[Row]:
    """RMSE, NEES and NIS of both models."""
    rows = []
    for name, run, bound in (
        ("constant velocity", point, {name: 1.02 * value for name, value in REFERENCE.items()}),
        ("planar robot", robot, COURSE),
    ):
        summary = run.run()
        assert summary.rmse is not None
        assert summary.nees_mean is not None
        for slot, limit in bound.items():
            unit = "m/s" if slot.startswith("v") else "m"
            reach = min(limit, COURSE[slot])
            rows.append(Row(f"{name}: RMSE {slot}", summary.rmse[slot], reach, REFERENCE[slot], unit, 4))
        rows.append(Row(f"{name}: mean NEES", summary.nees_mean, None, float(summary.nees_dof), "", 2))
        for sensor, dof in (("laser", 2.0), ("radar", 3.0)):
            nis = summary.sensors[sensor].nis_mean
            assert nis is not None
            rows.append(Row(f"{name}: mean NIS {sensor}", nis, None, dof, "", 2))
    return rows


def dresden_rows(run: Recorded) -> list[Row]:
    """Residuals and outages beside the reference filter, run here."""
    rows, summary = rows_of(run), run.run()
    apart = ctrv_reference.filtered(rows, rows.t_s)
    rms_m = float(np.sqrt(np.nanmean(apart**2)))
    figures = [Row("RMS distance to the new fixes", rms(run), 4.40, rms_m)]
    for outage_s, reach_m in OUTAGES_S.items():
        what = "no fix from {:.0f} s to {:.0f} s: distance at the end".format(*outage_s)
        figures.append(
            Row(what, outage_m(run, *outage_s), reach_m, ctrv_reference.ends_m(rows, rows.t_s, outage_s))
        )
    verdicts = summary.sensors["gps"].verdicts
    figures.append(Row("rows taken as a fix", verdicts["used"], None, float(rows.fresh.sum()), "", 0))
    figures.append(Row("rows refused as held", verdicts["held"], None, float((~rows.fresh).sum()), "", 0))
    for sensor, dof in (("gps", 2.0), ("speed", 1.0), ("yaw_rate", 1.0)):
        nis = summary.sensors[sensor].nis_mean
        assert nis is not None
        figures.append(Row(f"mean NIS {sensor}, beside its degrees of freedom", nis, None, dof, "", 2))
    return figures


def rms(run: Recorded) -> float:
    """RMS distance to the new fixes, m."""
    return float(np.sqrt(np.mean(fix_residuals_m(run) ** 2)))


def rows_of(run: Recorded) -> Rows:
    """The recording for the reference filter; it starts along the course, as that of the exercise does."""
    gps = run.readings[run.of("gps")]
    parts = [
        gps["z"][:, :2],
        run.readings[run.of("speed")]["z"][:, :1],
        run.readings[run.of("yaw_rate")]["z"][:, :1],
    ]
    written_s = (gps["arrival_ns"] - gps["arrival_ns"][0]) / 1e9
    return Rows(
        run.t_s[run.of("gps")], np.hstack(parts), float(np.radians(90.0 - FIRST_COURSE_DEG)), written_s
    )


def changed(assembly: Assembly, sections: dict[str, dict[str, Any]]) -> Assembly:
    """The same configuration with other values; a sensor's section is named `sensor.NAME`."""
    config = assembly.config
    for section, values in sections.items():
        if section.startswith("sensor."):
            name = section.removeprefix("sensor.")
            sensors = config.sensor | {name: config.sensor[name].model_copy(update=values)}
            config = config.model_copy(update={"sensor": sensors})
        else:
            part = getattr(config, section).model_copy(update=values)
            config = config.model_copy(update={section: part})
    return assemble(config)


def dresden_variants(run: Recorded) -> str:
    """What the figures of the drive become when one number of the configuration is another."""
    variants: list[tuple[str, Recorded]] = [("as configured", run)]
    for what, sections in (
        ("gps 2 m", {"sensor.gps": {"noise_std": {"x_m": 2.0, "y_m": 2.0}}}),
        ("gps 6 m", {"sensor.gps": {"noise_std": {"x_m": 6.0, "y_m": 6.0}}}),
        ("speed 0.5 m/s", {"sensor.speed": {"noise_std": {"speed_m_s": 0.5}}}),
        ("speed 2 m/s", {"sensor.speed": {"noise_std": {"speed_m_s": 2.0}}}),
        ("gyro 0.005 rad/s", {"sensor.yaw_rate": {"noise_std": {"yaw_rate_rad_s": 0.005}}}),
        ("gyro 0.02 rad/s", {"sensor.yaw_rate": {"noise_std": {"yaw_rate_rad_s": 0.02}}}),
        ("gyro's bias three times steadier", {"model": {"gyro_bias_noise_rad_s_sqrt_s": 3e-5}}),
        ("gyro's bias three times livelier", {"model": {"gyro_bias_noise_rad_s_sqrt_s": 3e-4}}),
        ("repeated fixes counted as fresh", {"sensor.gps": {"repeats": "fresh"}}),
    ):
        variants.append((what, dataclasses.replace(run, assembly=changed(run.assembly, sections))))
    lines = ["| | RMS to fixes | 60 to 70 s | 60 to 90 s | 100 to 130 s |", "|---|---|---|---|---|"]
    for what, variant in variants:
        figures = [rms(variant), *(outage_m(variant, *outage_s) for outage_s in OUTAGES_S)]
        lines.append(f"| {what} | " + " | ".join(f"{value:.2f} m" for value in figures) + " |")
    lines.append("| the reference filter | " + reference_line(run, steady=True))
    lines.append(
        "| the reference filter, rows at the time they were written | " + reference_line(run, steady=False)
    )
    return "\n".join(lines)


def reference_line(run: Recorded, *, steady: bool) -> str:
    """The rest of a line about the reference filter."""
    rows = rows_of(run)
    t_s = rows.t_s if steady else rows.written_s
    rms_m = float(np.sqrt(np.nanmean(ctrv_reference.filtered(rows, t_s) ** 2)))
    figures = [rms_m, *(ctrv_reference.ends_m(rows, t_s, outage_s) for outage_s in OUTAGES_S)]
    return " | ".join(f"{value:.2f} m" for value in figures) + " |"


def outages_everywhere(run: Recorded) -> str:
    """Outages of 10 s and 30 s that begin at every tenth second, beside the reference filter's."""
    rows = rows_of(run)
    lines = [
        "| no fix for | outages | median | worst | reference: median | worst |",
        "|---|---|---|---|---|---|",
    ]
    for length_s in (10.0, 30.0):
        spans = [(start_s, start_s + length_s) for start_s in np.arange(20.0, 216.0 - length_s, 10.0)]
        ours = [outage_m(run, *span) for span in spans]
        theirs = [ctrv_reference.ends_m(rows, rows.t_s, span) for span in spans]
        figures = [np.median(ours), np.max(ours), np.median(theirs), np.max(theirs)]
        cells = " | ".join(f"{value:.1f} m" for value in figures)
        lines.append(f"| {length_s:.0f} s | {len(spans)} | {cells} |")
    return "\n".join(lines)
