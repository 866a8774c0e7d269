"""Many runs through one engine's step, every alarm written down."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.assembly import Assembly, assemble
from fusiond.config import Config
from fusiond.engine.engine import Engine
from fusiond.types import Alarm, Role
from tools.scoreboard.plants import Floats

Records = NDArray[Any]
Integers = NDArray[np.int64]


def assembled(config: Mapping[str, Any]) -> Assembly:
    """The configuration, assembled."""
    return assemble(Config.model_validate(dict(config)))


@dataclass(slots=True)
class Listener:
    """Stands where the judge stands, writes every alarm down and lets the estimator go on."""

    heard: list[tuple[int, int, int, int]] = field(default_factory=list)

    def consider(self, engine: Engine) -> None:
        """Note the time, the kind, the sensor and the cell of the alarm."""
        monitor = engine.track[0]["monitor"]
        row = (engine.track[0]["t_ns"], monitor["alarm"], monitor["alarm_sensor"], monitor["alarm_cell"])
        self.heard.append((int(row[0]), int(row[1]), int(row[2]), int(row[3])))
        monitor["alarm"] = Alarm.NONE


@dataclass(frozen=True, slots=True)
class Alarms:
    """What was raised, a row each, in the order of time.

    run, step: where.   kind: `types.Alarm`.   sensor, cell: who raised it.
    """

    run: Integers
    step: Integers
    kind: Integers
    sensor: Integers
    cell: Integers

    def only(self, *kinds: Alarm) -> Alarms:
        """Those of these kinds."""
        kept = np.isin(self.kind, [int(kind) for kind in kinds])
        return Alarms(self.run[kept], self.step[kept], self.kind[kept], self.sensor[kept], self.cell[kept])

    def first(self, runs: int, onset: int) -> Floats:
        """(runs,) steps from the onset (1: with the first faulty reading) to the first alarm; infinite without one."""
        delay = np.full(runs, np.inf)
        late = self.step >= onset
        np.minimum.at(delay, self.run[late], self.step[late] - onset + 1.0)
        return delay


def readings_of(assembly: Assembly, z: Floats) -> Records:
    """(runs, k) records of (runs, steps, s) readings, each run from the first step on; inputs read 0."""
    runs, steps, _ = z.shape
    sensors = [sensor.number for sensor in assembly.layout.sensors if sensor.role is not Role.INPUT]
    inputs = [sensor.number for sensor in assembly.layout.sensors if sensor.role is Role.INPUT]
    columns = inputs + sensors
    filled = np.zeros((runs, steps, len(columns)), assembly.layout.reading)
    filled["t_ns"] = (np.arange(1, steps + 1) * step_ns(assembly))[None, :, None]
    filled["sensor"], filled["length"] = columns, 1
    filled["z"][:, :, len(inputs) :, 0] = z
    return filled.reshape(runs, -1)


def step_ns(assembly: Assembly) -> int:
    """Length of a step."""
    return round(assembly.resolved.process.step_s * 1e9)


def listen(assembly: Assembly, engine: Engine, z: Floats) -> Alarms:
    """Run (runs, steps, s) readings through the step, each run from a fresh beginning."""
    listener = Listener()
    engine._judge = listener  # type: ignore[assignment]
    rows: list[tuple[int, int, int, int, int]] = []
    for run, readings in enumerate(readings_of(assembly, z)):
        engine.reset()
        engine.process(readings)
        rows += [(run, *row) for row in listener.heard]
        listener.heard.clear()
    table = np.array(rows, dtype=np.int64).reshape(-1, 5)
    return Alarms(table[:, 0], table[:, 1] // step_ns(assembly) - 1, table[:, 2], table[:, 3], table[:, 4])
