"""The figures of sensor nodes on docs/seed_004.md: what is sent, against what might have been."""

from __future__ import annotations

import functools
from functools import partial

import numpy as np

from fusiond.simulation.registry import simulate
from tools.pages import bank_truth
from tools.pages.bank_truth import Known
from tools.pages.bank_truth import System as Plant
from tools.pages.consistency import CASES, simulations
from tools.pages.node_runs import Outcome, System, outcome
from tools.pages.seed_row import Row, between, within
from tools.pages.tracklet_truth import thinned

R = (0.01, 0.04)
"""Of the two sensors of configs/two_nodes.toml."""
LINEAR_RUNS, PLANAR_RUNS = 200, 100
BORN_NS = 5_000_000_000
"""When one of them is born again, in the middle of a run."""
THREE = {"roof": ["gps"], "road": ["radar"], "body": ["beacon", "gyro", "heading", "wheel_speed"]}
"""Machines among which the sensors of configs/planar.toml are shared out."""


@functools.cache
def linear() -> Outcome:
    """configs/two_nodes.toml through its three daemons' engines."""
    runs = [simulate("constant_velocity", seed, 20.0, R=R) for seed in range(LINEAR_RUNS)]
    return outcome(System("two_nodes"), runs)


@functools.cache
def planar(born_ns: int = 0) -> Outcome:
    """configs/planar.toml through four; where `born_ns` is given, one node starts anew then."""
    system = System("planar", {"service": {"nodes": THREE}})
    return outcome(system, simulations(CASES["planar"], PLANAR_RUNS), born_ns)


def ratio(born_ns: int = 0) -> float:
    """RMSE of the center over that of the daemon alone."""
    return planar(born_ns).rmse_center / planar(born_ns).rmse_alone


def through_engines() -> list[Row]:
    """What the center makes of what nodes send, beside a daemon that hears all sensors itself."""
    two, three = "two nodes, linear", "three nodes, planar drive with radar, beacons and GPS"
    born = "the same, one node killed and born anew"
    return [
        Row(f"{two}: center from alone, in its deviations, at most", "0", lambda: linear().apart, "{:.0e}",
            between(0.0, 1e-9), False),
        Row(f"{two}: RMSE center / alone", "1", lambda: linear().rmse_center / linear().rmse_alone, "{:.6f}",
            within(1.0, 1e-9), False),
        Row(f"{two}: NEES of the center, {LINEAR_RUNS} runs", "2, in 1.73 to 2.29", lambda: linear().nees_center.value,
            "{:.2f}", lambda _: linear().nees_center.inside, False),
        Row(f"{three}: RMSE center / alone", "1.00 +- 0.01", ratio, "{:.4f}", within(1.0, 0.01), False),
        Row(f"{three}: NEES alone, {PLANAR_RUNS} runs", "6, in 5.34 to 6.70", lambda: planar().nees_alone.value,
            "{:.2f}", lambda _: planar().nees_alone.inside, False),
        Row(f"{three}: NEES of the center", "6, in 5.34 to 6.70", lambda: planar().nees_center.value,
            "{:.2f}", lambda _: planar().nees_center.inside, False),
        Row(f"{born}: RMSE center / alone", "1.00 +- 0.01", partial(ratio, BORN_NS), "{:.4f}",
            within(1.0, 0.01), False),
        Row(f"{born}: NEES of the center", "6, in 5.34 to 6.70", lambda: planar(BORN_NS).nees_center.value,
            "{:.2f}", lambda _: planar(BORN_NS).nees_center.inside, False),
    ]  # fmt: skip


def point() -> Plant:
    """The plant of configs/two_nodes.toml."""
    G, C = np.array([[0.005], [0.1]]), np.array([[1.0, 0.0]])
    noises = tuple(np.array([[r]]) for r in R)
    return Plant(np.array([[1.0, 0.1], [0.0, 1.0]]), G @ G.T, (C, C), noises, np.eye(2))


@functools.cache
def seldom(every: int) -> Known:
    """A message for so many readings, after 200 steps."""
    return thinned(point(), every, 200 // every)


def reported(every: int) -> float:
    """Reported over true."""
    return seldom(every).caution


def added() -> float:
    """Local estimates, each with the whole prior and process noise, added up as if they were independent."""
    return bank_truth.bank(point(), (1.0, 1.0), bank_truth.summed, 200).caution


def unused() -> list[Row]:
    """What is not done, and why: algebra on the same plant."""
    rows = [
        Row("tracklet of 1 reading: reported / true", "1", partial(reported, 1), "{:.6f}", within(1.0, 1e-9))
    ]
    for every in (5, 10, 20):
        what = f"one tracklet for {every} readings instead: reported / true"
        rows.append(Row(what, "below 1, optimistic", partial(reported, every), "{:.3f}", between(0.0, 0.999)))
    what = "local estimates added up instead: reported / true"
    return [*rows, Row(what, "below 1, optimistic", added, "{:.3f}", between(0.0, 0.999))]


def nodes() -> list[Row]:
    """The section of the page."""
    return [*through_engines(), *unused()]
