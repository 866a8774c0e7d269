"""The tables of docs/smoothing.md."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from fusiond.assembly.assembly import Assembly
from fusiond.simulation.flight import flight
from fusiond.types import NANOSECONDS
from tools.pages.consistency import CASES, simulations
from tools.pages.recorded import Recorded
from tools.pages.smoothing import ONE_FILTER, Gain, Smoothed, gain_of, gain_on, smoothed_run
from tools.pages.trials import Floats, Records, configured, records

FIRST_SEED = 1000
RUNS = {"minicar": 200, "wall_robot": 200, "reference_plant": 200, "constant_velocity": 200, "planar": 50}
FLIGHTS, FLIGHT_NS = 30, 20 * NANOSECONDS
WINDOW_S = 2.0
"""Fixes are withheld in every other window of this length."""
RATES = ("rate_x", "rate_y", "rate_z")


def flights(assembly: Assembly) -> Iterator[tuple[Records, Any]]:
    """Simulated flights and their truth."""
    for seed in range(FIRST_SEED, FIRST_SEED + FLIGHTS):
        readings, truth = flight(seed, FLIGHT_NS)

        def exact(t_ns: Any, truth: Any = truth) -> Floats:
            columns = [np.interp(t_ns, truth.t_ns, column) for column in truth.values.T]
            return np.column_stack([*columns, *[np.zeros(len(t_ns))] * len(RATES)])

        yield records(assembly.layout, sorted(readings, key=lambda one: one.t_ns)), exact


def row_of(name: str, runs: int, gain: Gain) -> str:
    """One line of the first table."""
    ratios = " ".join(f"{value:.2f}" for value in gain.ratio)
    nees = gain.nees
    inside = "yes" if nees.inside else "**no**"
    return (
        f"| `{name}` | {runs} | {ratios} | {nees.value:.2f} | {nees.low:.2f} to {nees.high:.2f} | {inside} |"
    )


def simulated_table(names: Iterable[str] = (*RUNS, "flight")) -> str:
    """RMSE and NEES of every simulated system."""
    lines = [
        "| system | runs | RMSE, smoothed over filtered | NEES | band | inside |",
        "|---|---|---|---|---|---|",
    ]
    for name in names:
        if name == "flight":
            assembly = configured("flight", ONE_FILTER)
            lines.append(row_of(name, FLIGHTS, gain_of(assembly, flights(assembly))))
        else:
            lines.append(
                row_of(
                    name,
                    RUNS[name],
                    gain_on(CASES[name], simulations(CASES[name], RUNS[name], FIRST_SEED))[1],
                )
            )
    return "\n".join(lines)


def walker_errors(run: Recorded, smoothed: Smoothed) -> tuple[dict[str, float], dict[str, float]]:
    """RMSE by name of filter and smoother, against the recording's truth, derived outputs included."""
    assert run.truth is not None
    outputs = run.assembly.engine().outputs
    names = [slot.name for slot in run.assembly.layout.states]
    truth, _ = run.truth.at(smoothed.states["state_t_ns"])
    found = []
    for states in (smoothed.filtered["x"], smoothed.states["x"]):
        said = [dict(zip(names, x.tolist(), strict=True)) | outputs(x) for x in states]
        wanted = [name for name in run.truth.names if name in said[0]]
        error = np.array([[one[name] for name in wanted] for one in said])
        error -= truth[:, [run.truth.names.index(name) for name in wanted]]
        found.append(dict(zip(wanted, np.sqrt(np.mean(error**2, axis=0)).tolist(), strict=True)))
    return found[0], found[1]


def withheld_m(run: Recorded) -> dict[str, tuple[float, float]]:
    """RMS distance of filter and smoother from the position (m) and velocity (m/s) of fixes that neither was given."""
    window = ((run.t_s / WINDOW_S).astype(np.int64) % 2 == 1) & (run.t_s > WINDOW_S)
    fixes = {"position": ("gnss_position", slice(0, 3)), "velocity": ("gnss_velocity", slice(3, 6))}
    hidden = {what: run.used(sensor) & window for what, (sensor, _) in fixes.items()}
    smoothed = smoothed_run(run.assembly, run.readings[~(hidden["position"] | hidden["velocity"])])
    found = {}
    for what, (_, place) in fixes.items():
        withheld = run.readings[hidden[what]]
        row = np.searchsorted(smoothed.states["state_t_ns"], withheld["t_ns"], side="right") - 1
        both = []
        for states in (smoothed.filtered["x"][row], smoothed.states["x"][row]):
            off = states[:, place] - withheld["z"][:, :3]
            both.append(float(np.sqrt(np.mean(np.sum(off**2, axis=1)))))
        found[what] = (both[0], both[1])
    return found


def recordings_table(walkers: Iterable[tuple[str, Recorded]], iris: Recorded) -> str:
    """Filter beside smoother on recordings."""
    lines = ["| recording | what | filter | smoothed |", "|---|---|---|---|"]
    for name, run in walkers:
        before, after = walker_errors(run, smoothed_run(run.assembly, run.readings))
        for what, value in before.items():
            unit = "m/s" if what.startswith("v") else "m"
            lines.append(f"| `{name}` | RMSE of {what} | {value:.3f} {unit} | {after[what]:.3f} {unit} |")
    for what, (filtered, smooth) in withheld_m(iris).items():
        unit = "m/s" if what == "velocity" else "m"
        lines.append(
            f"| `px4_iris` | {what}, from withheld fixes | {filtered:.3f} {unit} | {smooth:.3f} {unit} |"
        )
    return "\n".join(lines)
