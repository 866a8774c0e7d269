"""The tables of docs/vehicle.md: bound, manoeuvres, outage, sideslip."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusiond.simulation.tables import Floats
from fusiond.simulation.vehicle_manoeuvres import SEED_002, Manoeuvre
from fusiond.simulation.vehicle_sensors import readings
from tools.pages.multibody import manoeuvre
from tools.pages.sideslip import course_of, lateral_velocity_rmse
from tools.pages.trials import configured
from tools.pages.vehicle_bound import bound, ensemble, score
from tools.pages.vehicle_runs import Drive, follow, own_equations, withheld

BOUNDED = (SEED_002[0], SEED_002[3], SEED_002[6])
SETTLED = 1000
"""Milliseconds left out at the start: the manoeuvres begin at one second."""
OUTAGE_S = (3.0, 6.5)
SLOW_SENSORS = ("gps", "magnetometer")
STATES = ("vx", "vy", "yaw rate", "front force", "rear force", "yaw", "x", "y")


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def bound_table(runs: int = 1000) -> str:
    """RMSE over posterior bound, state by state, on the filter's own model."""
    rows = []
    for number, asked in enumerate(BOUNDED):
        made = ensemble(asked, runs, 2.0, seed=number)
        found = score(made, made.assembly.engine(), 1_000_000 * (number + 1), bounded=20)
        cells = [f"{r:.3f} +- {s:.3f}" for r, s in zip(found.ratio, found.ratio_std, strict=True)]
        rows.append([asked.name, *cells, f"{found.nees.mean():.2f} +- {4.0 / np.sqrt(runs):.2f}"])
    return table(["start as in", *STATES, "NEES at the end (8)"], rows)


def quantities(squares: Floats) -> Floats:
    """RMSE of vx, vy, yaw rate and position from mean squares of the states."""
    mean = np.array([squares[0], squares[1], squares[2], squares[6] + squares[7]])
    return np.asarray(np.sqrt(mean), dtype=np.float64)


def mean_squares(drives: Sequence[Drive]) -> Floats:
    """(10,) over drives and time, from the second on at which the manoeuvre begins."""
    return np.asarray(np.mean([np.mean(d.error[SETTLED:] ** 2, axis=0) for d in drives], axis=0))


def manoeuvre_table(seeds: int = 20) -> str:
    """RMSE on the multi-body truth, over that on the filter's own equations, over the bound; all seven."""
    assembly = configured("ground_vehicle")
    engine = assembly.engine()
    start_std = assembly.config.initial.std
    rows = []
    for asked in SEED_002:
        motion = manoeuvre(asked)
        own = own_equations(motion, assembly)
        real = quantities(mean_squares([follow(engine, motion, readings(motion, k)) for k in range(seeds)]))
        same = quantities(mean_squares([follow(engine, own, readings(own, k)) for k in range(seeds)]))
        best = quantities(bound(assembly.resolved, motion, start_std)[SETTLED:].mean(axis=0))
        cells = [
            f"{value:.3g} ({r:.3f}, {b:.2f})"
            for value, r, b in zip(real, real / same, real / best, strict=True)
        ]
        lateral = f"{np.abs(motion.states[:, 9]).max():.1f}"
        rows.append([asked.name, lateral, *cells])
    head = ["manoeuvre", "largest ay, m/s^2", "vx, m/s", "vy, m/s", "yaw rate, rad/s", "position, m"]
    return table(head, rows)


def outage_table(seeds: int = 20) -> str:
    """What is left of the position while only the IMU speaks."""
    engine = configured("ground_vehicle").engine()
    rows = []
    for asked in SEED_002:
        motion = manoeuvre(asked)
        cells = [asked.name]
        drives = [
            follow(engine, motion, withheld(readings(motion, k), SLOW_SENSORS, *OUTAGE_S))
            for k in range(seeds)
        ]
        for moment_s in (OUTAGE_S[0], OUTAGE_S[1], OUTAGE_S[1] + 0.5):
            row = round(moment_s * 1000) - 2
            squares = np.mean([d.error[row] ** 2 for d in drives], axis=0)
            claimed = np.mean([d.P[row, 6, 6] + d.P[row, 7, 7] for d in drives])
            cells.append(f"{np.sqrt(squares[6] + squares[7]):.3f} ({np.sqrt(claimed):.3f})")
        rows.append(cells)
    head = ["manoeuvre", "position just before, m", "after 3.5 s without, m", "half a second later, m"]
    return table(head, rows)


def sideslip_table(seeds: int = 20) -> str:
    """Lateral velocity of the single-track filter, with its readings and without."""
    engine = configured("single_track").engine()
    rows = []
    for kind in ("dlc", "jturn"):
        for speed in (60.0, 90.0, 120.0, 140.0):
            asked = Manoeuvre(kind, speed)
            course = course_of(manoeuvre(asked))
            fused = lateral_velocity_rmse(engine, course, seeds)
            alone = lateral_velocity_rmse(engine, course, seeds, with_imu=False)
            largest = [f"{np.abs(course.ay).max():.1f}", f"{np.abs(course.vy).max():.3f}"]
            rows.append([asked.name, *largest, f"{alone:.4f}", f"{fused:.4f}"])
    head = ["manoeuvre", "largest ay, m/s^2", "largest vy, m/s", "model alone, RMSE m/s", "fused, RMSE m/s"]
    return table(head, rows)
