"""Kinds that show only under motion: a scale, a delay; and an input that lies while the loop is closed."""

from __future__ import annotations

import numpy as np

from fusiond.demo.injecting import inject_into, measured_of
from fusiond.simulation import rig
from fusiond.simulation.faults import parse_faults
from fusiond.simulation.faults_injection import Injection
from fusiond.simulation.registry import simulate
from fusiond.types import NANOSECONDS, TICK, Health, Kind, ServiceHealth
from tools.pages.trials import configured, records, steer
from tools.scoreboard.bands import share
from tools.scoreboard.board import Effort, Result, Row
from tools.scoreboard.judging import NAMED

PROMISE = {"mean_time_between_false_alarms_s": 36_000.0}
ONSET_S, END_S = 20.0, 50.0
MOVING = (
    ("radar", "scale=1.07", Kind.SCALE, 1.07, 0), ("wheel_speed", "scale=1.07", Kind.SCALE, 1.07, None),
    ("radar", "delay=0.15", Kind.DELAY, 0.15, None), ("wheel_speed", "delay=0.15", Kind.DELAY, 0.15, None),
    ("gps", "delay=0.15", Kind.DELAY, 0.15, None),
)  # fmt: skip
"""Sensor, fault, kind to be named, its size as reported, and the one channel that errs."""
GOAL_M, HELD_M, LAST_S = 2.0, 0.05, 10.0
INPUT_FAULTS = (("broken", Kind.SILENT), ("stuck", Kind.STUCK), ("bias=0.5", Kind.BIAS))


def moving_rows(effort: Effort, result: Result) -> None:
    """Scale and delay on a vehicle whose speed and yaw rate wander."""
    assembly = configured("planar", {"faults": PROMISE})
    engine = assembly.engine()
    for sensor, fault, kind, size, channel in MOVING:
        number, runs = assembly.layout.numbers[sensor], effort.runs(8, 2)
        named = fitting = wrong = 0
        for seed in range(runs):
            given = records(assembly.layout, simulate("planar", 40_000 + seed, END_S).readings)
            given = given[np.lexsort((given["sensor"], given["t_ns"]))]
            where = sensor if channel is None else f"{sensor}.{channel}"
            engine.reset()
            lies = inject_into([given], assembly, [f"{where}.{fault}@{ONSET_S}"], seed)
            reports = engine.process(np.concatenate(list(lies)))
            told = np.flatnonzero(np.isin(reports["health"][:, number], NAMED))
            last = reports[told[-1]] if told.size else reports[0]
            right = bool(told.size and last["fault"][number] == kind)
            near = bool(abs(last["fault_size"][number] - size) <= 2.0 * last["fault_std"][number])
            others = bool(np.delete(np.isin(reports["health"], NAMED).any(axis=0), number).any())
            named, fitting, wrong = named + right, fitting + (right and near), wrong + others
        band = share(fitting, runs)
        what = (
            f"{sensor} with {fault} under motion, named {kind.label} its size within 2 std when last told of "
        )
        what += f"in {END_S - ONSET_S:.0f} s; 95 % between {band.low:.0%} and {band.high:.0%}; "
        what += f"named so {named} of {runs}, another sensor named in {wrong}"
        identity = f"8.{kind.label}.{sensor}"
        result.rows.append(
            Row(identity, what, band.value, "of runs", "", None, ">= 0.95", band.value >= 0.95)
        )


def input_rows(effort: Effort, result: Result) -> None:
    """The mini car's accelerometer, which drives its filter, in the closed loop."""
    assembly = configured("minicar", {"faults": PROMISE})
    engine, number = assembly.engine(), assembly.layout.numbers["accelerometer"]
    for fault, kind in INPUT_FAULTS:
        held = named = degraded = 0
        runs, worst = effort.runs(8, 2), 0.0
        for seed in range(runs):
            car = rig.minicar(seed)
            car.faults = Injection(parse_faults([f"accelerometer.{fault}@10"]), measured_of(assembly), seed)
            run = steer(engine, car, round(30 * NANOSECONDS))
            tick = np.zeros(1, assembly.layout.reading)
            tick["sensor"], tick["t_ns"] = TICK, run.loop.t_ns[-1]
            last = engine.process(tick)[0]
            late = run.loop.t_ns >= run.loop.t_ns[-1] - round(LAST_S * NANOSECONDS)
            off = float(np.sqrt(np.mean((run.loop.states[late, 0] - GOAL_M) ** 2)))
            worst = max(worst, off)
            named += last["fault"][number] == kind and last["health"][number] != Health.HEALTHY
            degraded += last["service"] == ServiceHealth.DEGRADED
            held += off <= HELD_M
        ok = named == held == degraded == runs
        what = f"mini car's accelerometer {fault} from 10 s on: named {kind.label} in {named}, degraded in {degraded}, "
        what += f"goal held within {HELD_M * 100:.0f} cm in {held} of {runs}; "
        what += f"worst distance, rms over the last {LAST_S:.0f} s"
        result.rows.append(Row(f"8.input.{fault.split('=')[0]}", what, worst, "m", "", None,
                               f"<= {HELD_M}, named", ok))  # fmt: skip


def kinds_part(effort: Effort) -> Result:
    """Scale, delay and a lying input."""
    result = Result()
    moving_rows(effort, result)
    input_rows(effort, result)
    return result
