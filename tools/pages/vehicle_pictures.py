"""Pictures of docs/vehicle.md, as SVG with the same bytes at every run. Needs matplotlib."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fusiond.simulation.vehicle_manoeuvres import SEED_002, Manoeuvre
from fusiond.simulation.vehicle_sensors import readings
from tools.pages.figures import figure
from tools.pages.multibody import manoeuvre
from tools.pages.trials import configured
from tools.pages.vehicle_runs import Drive, follow, withheld
from tools.pages.vehicle_tables import OUTAGE_S, SLOW_SENSORS

COLOURS = {60.0: "#00798c", 90.0: "#edae49", 120.0: "#d1495b", 160.0: "#8d6a9f"}
THIN = 50
"""Milliseconds between two points: 20 a second are enough for a picture."""
SEEDS = 20


def drives(asked: Manoeuvre, seeds: int = SEEDS) -> list[Drive]:
    """The filter on one manoeuvre, with noise of several seeds."""
    engine, motion = configured("ground_vehicle").engine(), manoeuvre(asked)
    return [follow(engine, motion, readings(motion, seed)) for seed in range(seeds)]


def errors(path: Path) -> None:
    """The seed's figure 4: errors of vy and yaw rate, one run thin, RMS over all seeds thick."""
    with figure(path, 9.5, 5.6) as drawn:
        axes = drawn.subplots(2, 2, sharex="col")
        for asked in SEED_002:
            found = drives(asked)
            column = 0 if asked.kind == "dlc" else 1
            for row, state in ((0, 1), (1, 2)):
                rms = np.sqrt(np.mean([d.error[:, state] ** 2 for d in found], axis=0))
                t_s, colour = found[0].t_s[::THIN], COLOURS[asked.speed_km_h]
                axes[row, column].plot(t_s, found[0].error[::THIN, state], color=colour, lw=0.5, alpha=0.6)
                axes[row, column].plot(
                    t_s, rms[::THIN], color=colour, lw=1.6, label=f"{asked.speed_km_h:g} km/h"
                )
        for column, title in enumerate(("double lane change", "J-turn")):
            axes[0, column].set(title=title, xlim=(1.0, None), ylim=(-0.2, 0.2), ylabel="error of vy, m/s")
            axes[1, column].set(ylim=(-0.003, 0.003), ylabel="error of yaw rate, rad/s", xlabel="time, s")
            axes[0, column].legend(
                ncols=4,
                fontsize=7.5,
                loc="upper right",
                title=f"thick: RMS of {SEEDS} seeds, thin: one of them",
                title_fontsize=7.5,
            )


def outage(path: Path) -> None:
    """Position error with and without the GPS, and what the filter says of it."""
    asked = SEED_002[0]
    engine, motion = configured("ground_vehicle").engine(), manoeuvre(asked)
    cases: tuple[tuple[str, str, tuple[str, ...]], ...] = (
        ("gps throughout", "#00798c", ()),
        ("gps and magnetometer silent", "#d1495b", SLOW_SENSORS),
    )
    with figure(path, 6.5, 3.2) as drawn:
        axes = drawn.subplots()
        for name, colour, sensors in cases:
            found = [
                follow(engine, motion, withheld(readings(motion, seed), sensors, *OUTAGE_S))
                for seed in range(SEEDS)
            ]
            rms = np.sqrt(np.mean([d.error[:, 6] ** 2 + d.error[:, 7] ** 2 for d in found], axis=0))
            said = np.sqrt(found[0].P[:, 6, 6] + found[0].P[:, 7, 7])
            t_s = found[0].t_s[::THIN]
            axes.plot(t_s, rms[::THIN], color=colour, label=name)
            axes.plot(t_s, said[::THIN], color=colour, lw=0.9, ls="--")
        axes.axvspan(*OUTAGE_S, color="#999999", alpha=0.15)
        axes.set(
            xlim=(1.0, asked.duration_s), ylim=(0.0, 0.2), xlabel="time, s", ylabel="position error, RMS, m"
        )
        axes.legend(loc="upper left", fontsize=8, title="dashed: as the filter says", title_fontsize=8)


def draw(folder: Path) -> None:
    """Every picture of the page."""
    folder.mkdir(parents=True, exist_ok=True)
    errors(folder / "vehicle_errors.svg")
    outage(folder / "vehicle_outage.svg")
