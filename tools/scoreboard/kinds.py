"""Kinds that show only under motion: a scale, a delay; and an input that lies while the loop is closed."""

from __future__ import annotations

from collections import Counter

import numpy as np

from fusiond.demo.injecting import inject_into, measured_of
from fusiond.simulation import rig
from fusiond.simulation.faults import parse_faults
from fusiond.simulation.faults_injection import Injection
from fusiond.simulation.registry import simulate
from fusiond.types import NANOSECONDS, TICK, Health, Kind, ServiceHealth
from tools.pages.trials import Records, configured, records, steer
from tools.scoreboard.bands import share
from tools.scoreboard.board import Effort, Result, Row
from tools.scoreboard.judging import NAMED
from tools.scoreboard.tellable import Lie, lead

PROMISE_S = 36_000.0
PROMISE = {"mean_time_between_false_alarms_s": PROMISE_S}
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
    assembly, plain = configured("planar", {"faults": PROMISE}), configured("planar").engine()
    engine, layout = assembly.engine(), assembly.layout
    for sensor, fault, kind, size, channel in MOVING:
        number, runs = layout.numbers[sensor], effort.runs(24, 2)
        section = assembly.config.sensor[sensor]
        channels = tuple(range(engine.dof(number))) if channel is None else (channel,)
        lie = Lie(number, kind, size, round(ONSET_S * NANOSECONDS), channels)
        steps = tuple(float(std) for std in section.noise_std.values())
        count: Counter[str] = Counter()
        for seed in range(runs):
            given = records(layout, simulate("planar", 40_000 + seed, END_S).readings)
            given = given[np.lexsort((given["sensor"], given["t_ns"]))]
            where = sensor if channel is None else f"{sensor}.{channel}"
            lies = np.concatenate(list(inject_into([given], assembly, [f"{where}.{fault}@{ONSET_S}"], seed)))
            engine.reset()
            found = told(engine.process(lies), lie)
            can = lead(plain, lies, lie, steps).tells(PROMISE_S, section.rate_hz or 1.0)
            count.update(found + (["tellable"] if can else []))
            count["right"] += can and "fitting" in found
        _write(result, sensor, fault, kind, runs, count)


def told(reports: Records, lie: Lie) -> list[str]:
    """What the last report that blames the sensor gets right, and whether another one was ever blamed."""
    blamed = np.isin(reports["health"], NAMED)
    last = reports[np.flatnonzero(blamed[:, lie.sensor])[-1:]]
    named = bool(last.size and last["fault"][0, lie.sensor] == lie.kind)
    near = (
        named and abs(last["fault_size"][0, lie.sensor] - lie.size) <= 2.0 * last["fault_std"][0, lie.sensor]
    )
    others = bool(np.delete(blamed.any(axis=0), lie.sensor).any())
    return ["named"] * named + ["fitting"] * bool(near) + ["wrong"] * others


def _write(result: Result, sensor: str, fault: str, kind: Kind, runs: int, count: Counter[str]) -> None:
    """One row for all runs, one for those in which the motion tells the fault."""
    band, identity = share(count["fitting"], runs), f"8.{kind.label}.{sensor}"
    what = f"{sensor} with {fault} under motion, named {kind.label}, its size within 2 std, when last told of in "
    what += f"{END_S - ONSET_S:.0f} s; 95 % between {band.low:.0%} and {band.high:.0%}; named so "
    what += f"{count['named']} of {runs}, another sensor named in {count['wrong']}"
    result.rows.append(Row(identity, what, band.value, "of runs", "", None, ">= 0.95", band.value >= 0.95))
    can = count["tellable"]
    what = f"the same, of the {can} of {runs} runs in which one who knows size and onset could find it at the promised "
    what += "interval and tell it from a bias"
    value = count["right"] / can if can else 0.0
    result.rows.append(
        Row(f"{identity}.tellable", what, value, "of these" if can else "no run", "", None, ">= 0.95",
            can > 0 and value >= 0.95)
    )  # fmt: skip


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
