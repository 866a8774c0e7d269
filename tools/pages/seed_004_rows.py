"""The figures of docs/seed_004.md, one row each, by the section they stand in."""

from __future__ import annotations

import functools
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from fusiond.fusion.federated import shares
from tools.pages import bank_truth, exact_modes, ill_conditioned
from tools.pages.bank_truth import Known, System
from tools.pages.node_rows import nodes
from tools.pages.seed_004_modes import PRIOR, Ratios, plant, ratios, replayed, singular_start
from tools.pages.seed_row import Row, between, near, within

R_TEXT = Callable[[float], bool]
RECURSIONS = {"ud": "UD", "conventional": "Model 1", "information": "Woodbury", "seed": "as printed"}
FIGURES = {
    "gain M1": ("0.5345 published, 0.534538", 0.534538),
    "gain M2": ("0.0101 published, 0.010133", 0.010133),
    "gain M3": ("-0.4776 published, -0.477568", -0.477568),
    "C P C'": ("0.534538", 0.534538),
    "tr P": ("3.344542", 3.344542),
}
ONE = np.array([[1.0]])
NEW = "no figure before"


@functools.cache
def final(recursion: str) -> tuple[float, ...]:
    """M (P+ C' / R, R = 1), C P C' and tr P after 60 steps."""
    P = replayed(plant((1.0,), recursion=recursion), (1.0,), 60).P[-1]
    return float(P[0, 0]), float(P[1, 0]), float(P[2, 0]), float(P[0, 0]), float(np.trace(P))


def final_of(recursion: str, place: int) -> float:
    """One of them."""
    return final(recursion)[place]


def figures() -> list[Row]:
    """The published figures by every recursion."""
    rows = []
    for recursion, label in RECURSIONS.items():
        for place, (what, (said, expected)) in enumerate(FIGURES.items()):
            measure = partial(final_of, recursion, place)
            rows.append(
                Row(f"{what}, {label}", said, measure, "{:.6f}", within(expected, 1.1e-6), recursion != "ud")
            )
    return rows


def start_error(recursion: str, **said: Any) -> float:
    """Largest error of P over the run."""
    return singular_start(recursion, **said).error


@functools.cache
def ten_seeds(diagonal: str) -> tuple[float, ...]:
    """Errors of ten seeds, smallest first."""
    errors = [start_error("seed", seed_diagonal=diagonal, random_seed=seed) for seed in range(10)]
    return tuple(sorted(errors))


def spread(diagonal: str, worst: bool) -> float:
    """Median or worst of ten seeds."""
    return max(ten_seeds(diagonal)) if worst else float(np.median(ten_seeds(diagonal)))


def repairs(recursion: str) -> float:
    """Repairs in the summary of a replay."""
    return float(singular_start(recursion).repairs)


def start() -> list[Row]:
    """The singular start by each treatment."""
    rows = []
    for name, label in (("ud", "UD"), ("information", "Woodbury form")):
        rows.append(
            Row(f"{label}: error", "0", partial(start_error, name), "{:.1e}", between(0.0, 1e-12), False)
        )
    readings = {
        "variance": ("variance 1e-14", "1.3e-7", 1e-8, 1e-6),
        "deviation": ("deviation 1e-14", "9.6e-3", 1e-3, 1e-1),
        "identity_deviation": ("deviation 1e-4", "1.1e-4", 1e-5, 1e-3),
        "identity_variance": ("variance 1e-4", "1.5e-2", 1e-3, 1e-1),
    }
    for name, (label, said, low, high) in readings.items():
        for worst in (False, True):
            what = f"random diagonal, {label}: error, {'worst' if worst else 'median'}"
            expected = NEW if worst else f"{said} in one run"
            rows.append(
                Row(what, expected, partial(spread, name, worst), "{:.1e}", between(low, high), False)
            )
    for policy in ("shift", "eigen_floor", "restore"):
        measure = partial(start_error, "seed", guard=policy)
        rows.append(
            Row(f"guard `{policy}` instead: error", NEW, measure, "{:.1e}", between(0.0, 1e-2), False)
        )
    for name, label, said, most in (("seed", "as printed", "1 or 2", 2), ("conventional", "Model 1", "0", 0)):
        rows.append(
            Row(f"repairs, {label}", said, partial(repairs, name), "{:.0f}", between(min(most, 1), most))
        )
    return [*rows, Row("repairs, UD", "0", partial(repairs, "ud"), "{:.0f}", within(0.0, 0.0), False)]


TABLE = {
    "2 equal sensors": ((1.0,) * 2, 1.076, 1.26),
    "4 equal sensors": ((1.0,) * 4, 1.314, 1.44),
    "10 equal sensors": ((1.0,) * 10, 1.951, 1.58),
    "R = {1, 100}": ((1.0, 100.0), 1.22, 1.27),
    "R = {0.01, 1, 100}": ((0.01, 1.0, 100.0), 8.71, 1.54),
}


@functools.cache
def averaged_ratios(R: tuple[float, ...]) -> Ratios:
    """The averaged gain through replay."""
    return ratios("seed_averaged", R, 80 if len(R) > 4 else 150)


def averaged_loss(R: tuple[float, ...]) -> float:
    """True over optimal."""
    found = averaged_ratios(R)
    return (found.true or np.nan) / found.optimal


def averaged_caution(R: tuple[float, ...]) -> float:
    """Reported over true."""
    found = averaged_ratios(R)
    return found.reported / (found.true or np.nan)


def each_its_own() -> Known:
    """A sensor for each state of the reference plant, by algebra."""
    rows = tuple(np.eye(3)[[i]] for i in range(3))
    return bank_truth.averaged(System(exact_modes.A, np.array(PRIOR), rows, (ONE,) * 3, np.array(PRIOR)), 300)


def averaged() -> list[Row]:
    """The table of the averaged gain."""
    rows = []
    for label, (R, loss, caution) in TABLE.items():
        cheap = len(R) < 4
        said = (f"{label}: true / optimal", f"{loss}", partial(averaged_loss, R))
        rows.append(Row(*said, "{:.3f}", near(loss, 0.005), cheap))
        said = (f"{label}: reported / true", f"{caution}", partial(averaged_caution, R))
        rows.append(Row(*said, "{:.3f}", near(caution, 0.005), cheap))
    what = "a sensor for each state, algebra"
    rows.append(
        Row(f"{what}: true / optimal", "1.82", lambda: each_its_own().loss, "{:.3f}", near(1.82, 0.005))
    )
    rows.append(
        Row(f"{what}: reported / true", "1.66", lambda: each_its_own().caution, "{:.3f}", near(1.66, 0.005))
    )
    return rows


def unstable(a: float, sensors: int, steps: int) -> Known:
    """A scalar x+ = a x + w, Q = 1, one good sensor (R = 0.01) and junk (1e6) beside it, by algebra."""
    R = (0.01 * ONE, *(1e6 * ONE,) * (sensors - 1))
    return bank_truth.averaged(System(a * ONE, ONE, (ONE,) * sensors, R, ONE), steps)


def loss_after(a: float, sensors: int, steps: int) -> float:
    """True over optimal."""
    return unstable(a, sensors, steps).loss


def diverging() -> list[Row]:
    """The averaged gain on unstable plants."""
    rows = []
    for steps in (20, 40, 60, 80, 100):
        what = f"a = 1.5, 2 sensors: true / optimal after {steps} steps"
        rows.append(Row(what, "growing", partial(loss_after, 1.5, 2, steps), "{:.3g}", between(10.0, 1e6)))
    at_rest = lambda: float(unstable(1.5, 2, 400).true[0, 0])  # noqa: E731 (one figure, used once)
    rows.append(
        Row("a = 1.5: true variance at rest (optimum 0.0099)", "5557", at_rest, "{:.0f}", near(5557, 0.005))
    )
    for a, sensors, said, expected in (
        (1.5, 2, "5.6e5", 5.61e5),
        (1.2, 2, "40", 40.2),
        (1.2, 4, "3e5", 3.4e5),
    ):
        what = f"a = {a}, {sensors} sensors: true / optimal at rest"
        measure = partial(loss_after, a, sensors, 2000)
        rows.append(Row(what, said, measure, "{:.3g}", near(expected, 0.01)))
    return rows


@functools.cache
def drift() -> dict[str, float]:
    """Differences of the exact modes over 100 000 steps."""
    return exact_modes.worst_differences(100_000)


def drift_of(mode: str) -> float:
    """One of them."""
    return drift()[mode]


def exact() -> list[Row]:
    """One row for each exact mode."""
    labels = {
        "sequential": "sequential",
        "informed": "information",
        "federated_reset": "federated with full reset",
        "information_summed": "full-rate information sum",
    }
    return [
        Row(label, "below 1e-9", partial(drift_of, mode), "{:.1e}", between(0.0, 1e-9), False)
        for mode, label in labels.items()
    ]


def unlike(seed: int) -> System:
    """A random stable plant of four states with full noise; three sensors see one or two random combinations each."""
    rng = np.random.default_rng(seed)
    moves = rng.standard_normal((4, 4))
    moves *= rng.uniform(0.5, 0.97) / np.max(np.abs(np.linalg.eigvals(moves)))
    root = rng.standard_normal((4, 4))
    rows = [rng.standard_normal((rng.integers(1, 3), 4)) for _ in range(3)]
    return System(moves, root @ root.T, tuple(rows), tuple(np.eye(len(H)) for H in rows), root @ root.T)


def shared_out(system: System) -> Known:
    """Federated without reset, shares by information."""
    P = bank_truth.optimal(system, 60)
    P = system.A @ P @ system.A.T + system.Q
    told = [float(np.trace(np.linalg.solve(R, H @ P @ H.T))) for H, R in zip(system.C, system.R, strict=True)]
    return bank_truth.bank(system, shares(told), bank_truth.summed, 200)


@functools.cache
def elsewhere() -> tuple[float, float, float, float]:
    """Twenty plants: median and worst loss, least reported / true, least eigenvalue of reported - true (of trace)."""
    known = [shared_out(unlike(seed)) for seed in range(20)]
    losses = [each.loss for each in known]
    gaps = [np.linalg.eigvalsh(each.reported - each.true)[0] / np.trace(each.true) for each in known]
    return float(np.median(losses)), max(losses), min(each.caution for each in known), float(min(gaps))


def against_optimum(topology: str, R: tuple[float, ...]) -> float:
    """Reported over optimal, through replay."""
    found = ratios(topology, R)
    return found.reported / found.optimal


def decentralized() -> list[Row]:
    """Federated without reset, and covariance intersection beside it."""
    rows = []
    for R in ((1.0, 1.0), (1.0, 25.0), (0.1, 1.0, 10.0), (0.01, 1.0, 100.0)):
        what = f"federated / centralized, R = {{{', '.join(f'{r:g}' for r in R)}}}"
        measure = partial(against_optimum, "federated", R)
        rows.append(Row(what, "1.000 +- 0.002", measure, "{:.6f}", within(1.0, 0.002)))
    twenty: tuple[tuple[str, str, str, R_TEXT], ...] = (
        ("true / optimal, median", "1.006 to 1.059 in three plants", "{:.3f}", between(1.0, 1.1)),
        ("true / optimal, worst", "above 1", "{:.3f}", between(1.0, 3.0)),
        ("least reported / true", "at least 1", "{:.4f}", between(1.0 - 1e-9, 9.0)),
        ("least eigenvalue of reported - true", "not negative", "{:.1e}", between(-1e-9, 1.0)),
    )
    for place, (what, said, form, holds) in enumerate(twenty):
        name = f"20 plants, sensors that see different things: {what}"
        rows.append(Row(name, said, partial(elsewhere().__getitem__, place), form, holds))
    measure = partial(against_optimum, "covariance_intersection", (1.0, 1.0))
    what = "covariance intersection / centralized, R = {1, 1}"
    return [*rows, Row(what, "1.35, that of one sensor", measure, "{:.3f}", within(1.35, 0.01))]


def rounding_of(name: str, d: float) -> float:
    """Relative error of P+."""
    return ill_conditioned.outcome(name, d)[0]


def rounding() -> list[Row]:
    """The ill-conditioned update by recursion; a digit of such an error is rounding itself, so none is cheap."""
    rows = []
    for name, label in (("conventional", "Model 1"), ("joseph", "Joseph"), ("ud", "UD")):
        said, most = ("at most 1e-4", 1e-4) if name == "ud" else (NEW, 1.0)
        for d in (1e-4, 1e-6, 1e-7, 1e-8, 1e-12):
            measure = partial(rounding_of, name, d)
            rows.append(Row(f"{label}, d = {d:.0e}", said, measure, "{:.0e}", between(0.0, most), False))
    return rows


SECTIONS: dict[str, Callable[[], list[Row]]] = {
    "figures": figures,
    "start": start,
    "averaged": averaged,
    "diverging": diverging,
    "exact": exact,
    "decentralized": decentralized,
    "nodes": nodes,
    "rounding": rounding,
}
