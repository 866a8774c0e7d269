"""A regulated plant and the engine's own step in one compiled loop: millions of closed steps in a minute."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numba
import numpy as np

from fusiond.assembly.assembly import Assembly
from fusiond.engine.records import work_dtype
from fusiond.engine.step.sizes import SNAPSHOT_EVERY
from tools.scoreboard.plants import Floats

STEP_NS = 1_000_000_000
ROOM = 64
"""Snapshots of the history; nothing comes late here."""


@dataclass(frozen=True, slots=True)
class World:
    """The plant x+ = A x + B (u + w), the command late by `delay` steps, and sensors y_i = C x + v_i."""

    A: Floats
    B: Floats
    C: Floats
    Q: float
    R: tuple[float, ...]
    delay: int = 0


@cache
def loop_of(run: Any) -> Callable[..., int]:
    """The loop around one configuration's compiled step."""

    @numba.njit(nogil=True, error_model="numpy")
    def loop(
        engine: Any, A: Any, B: Any, C: Any, delay: int, w: Any, v: Any, there: Any, numbers: Any, x: Any,
        y: Any, u: Any, readings: Any, reports: Any, blank: Any, nothing: Any, first: int,
    ) -> int:  # fmt: skip
        tracks, desks, design, works, spares, ring, snapshots, marks = engine
        n = x.shape[0]
        queue = np.zeros(delay + 1)
        after = np.zeros(n)
        given = 0
        for k in range(w.shape[0]):
            y[k] = 0.0
            for i in range(n):
                y[k] += C[i] * x[i]
            queue[delay] = desks[0].command[0]
            for sensor in range(v.shape[1]):
                if there[k, sensor]:
                    readings[0].t_ns = (first + k) * STEP_NS
                    readings[0].sensor = numbers[sensor]
                    readings[0].length = 1
                    readings[0].z[0] = y[k] + v[k, sensor]
                    reports[0] = blank[0]
                    run(
                        tracks,
                        desks,
                        design,
                        works,
                        spares,
                        ring,
                        snapshots,
                        marks,
                        readings,
                        reports,
                        nothing,
                    )
                    if reports[0].command_due:
                        given += reports[0].command_valid
                        queue[delay] = reports[0].command[0]
            u[k] = queue[delay]
            for i in range(n):
                after[i] = B[i] * (queue[0] + w[k])
                for j in range(n):
                    after[i] += A[i, j] * x[j]
            for i in range(n):
                x[i] = after[i]
            for i in range(delay):
                queue[i] = queue[i + 1]
        return given

    return loop


class Closed:
    """One configuration closed around a simulated plant; state and engine go on from run to run."""

    def __init__(self, assembly: Assembly, world: World, sensors: tuple[str, ...]) -> None:
        layout = assembly.layout
        self.engine = assembly.engine()
        self._world, self._loop = world, loop_of(assembly.package.run)
        kept = SNAPSHOT_EVERY * ROOM
        spares = tuple(np.zeros(1, one) for one in (layout.track, layout.report, layout.reading))
        self._records = (
            self.engine.track, self.engine.desk, assembly.design, np.zeros(1, work_dtype(layout.shape)), spares,
            np.zeros(kept, layout.reading), np.zeros(ROOM + 2, layout.track), np.full(ROOM + 2, -1, np.int64),
        )  # fmt: skip
        self._numbers = np.array([layout.numbers[name] for name in sensors])
        self._x = np.zeros(len(world.A))
        self._one = np.zeros(1, layout.reading), np.zeros(1, layout.report), np.zeros(1, layout.report)
        self._nothing = np.zeros((0, layout.shape.errors, layout.shape.errors))
        self._done = 0

    def steps(self, rng: np.random.Generator, there: Any) -> tuple[Floats, Floats]:
        """y and u (k,) of the next steps; there: (k, sensors) which of them reads."""
        world, count = self._world, len(there)
        w = np.sqrt(world.Q) * rng.standard_normal(count)
        v = np.sqrt(np.array(world.R)) * rng.standard_normal((count, len(world.R)))
        y, u = np.zeros(count), np.zeros(count)
        self._loop(
            self._records, world.A, world.B, world.C, world.delay, w, v, there, self._numbers, self._x, y, u,
            *self._one, self._nothing, self._done,
        )  # fmt: skip
        self._done += count
        return y, u
