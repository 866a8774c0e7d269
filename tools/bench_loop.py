"""Age of a command at the actuator: the mini car under LQG, its loop closed over Zenoh by the daemon, beside an echo.

The stream is that of a car that does what it is told. Of anything else, as of one sensor alone that never moves, the
daemon finds that it lies: then it judges, several milliseconds for each alarm, and commands wait for that.
"""

from __future__ import annotations

import json
import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.assembly import load
from fusiond.engine.engine import Engine
from fusiond.service.publisher import SensorPublisher
from fusiond.service.reading_record import MAGIC
from fusiond.service.sessions import open_session, session_options
from fusiond.simulation.registry import simulate
from fusiond.simulation.rig import STEP_NS, minicar
from fusiond.types import NANOSECONDS
from tools.bench_service import CONFIG, NAME, Arrivals, centile, process
from tools.pages.trials import records

COMMAND_HZ = 50_000.0
"""Above the rate of readings: each of them has its command, but those that a tick of a daemon held up has overtaken."""
SETTLING = 500
"""Milliseconds after the start that are left out."""


class Car:
    """What a car has of the daemon: publishers of its two sensors, and the commands that come back."""

    def __init__(self, endpoint: str) -> None:
        self.session = open_session(session_options("client", connect=[endpoint]))
        self.back = Arrivals(self.session, "control")
        self._sensors = {
            name: SensorPublisher(NAME, name, encoding="record", session=self.session)
            for name in ("accelerometer", "ultrasonic")
        }
        for sensor in self._sensors.values():
            sensor.wait_until_heard()
        self.sent: dict[int, int] = {}

    def put(self, sensor: str, z: tuple[float, ...], stamp: int) -> None:
        """Send a reading, and remember when; of two with one stamp the first, which the command answers."""
        self.sent.setdefault(stamp, time.perf_counter_ns())
        self._sensors[sensor].publish(z, stamp)

    def force_n(self) -> float:
        """The newest command; none, or an echo: no force."""
        payload = self.back.came[-1][1].payload.to_bytes() if self.back.came else MAGIC
        if payload.startswith(MAGIC):
            return 0.0
        message = json.loads(payload)
        return float(message["u"]["force"]) if message["valid"] else 0.0


def drive(endpoint: str, seed: int, milliseconds: int = 2500) -> list[float]:
    """Ages of the commands, s, sorted: from the put of the reading that each answers to its arrival."""
    car, rig = Car(endpoint), minicar(seed)
    began_ns, wall_ns = time.perf_counter_ns(), time.time_ns()
    readings = rig.begin()
    for step in range(1, milliseconds + 1):
        for reading in readings:
            car.put(reading.sensor, reading.z, wall_ns + reading.t_ns)
        if step == SETTLING:
            car.sent = {}
        while (left_ns := began_ns + step * STEP_NS - time.perf_counter_ns()) > 0:
            time.sleep(left_ns / 1e9)
        readings = rig.advance(car.force_n())
    time.sleep(0.2)
    ages = car.back.ages_s(car.sent)
    car.session.close()
    if len(ages) < 0.5 * len(car.sent):
        raise RuntimeError(f"{endpoint}: {len(car.sent)} sent, only {len(ages)} answered")
    return ages


def bench_command_age(repeats: int = 5) -> dict[str, float]:
    """Ages of commands, and of what an echo makes of the same readings, in turn; medians over the repeats, us."""
    found: dict[str, list[float]] = {
        f"{name}_{p}": [] for name in ("echo", "command") for p in ("p50", "p99")
    }
    for seed in range(repeats):
        with (
            process("echo", "--topic", "control") as echo,
            process("daemon", "--command-hz", str(COMMAND_HZ)) as daemon,
        ):
            for name, endpoint in (("echo", echo), ("command", daemon)):
                ages = drive(endpoint, seed)
                for percent in (50, 99):
                    found[f"{name}_p{percent}"].append(centile(ages, percent) * 1e6)
    result = {f"{name}_us": sorted(each)[repeats // 2] for name, each in found.items()}
    return result | {"ratio": result["command_p99_us"] / result["echo_p99_us"]}


def longest_ms(engine: Engine, given: NDArray[Any], first: int) -> float:
    """Most CPU time that a reading takes from the `first` on, ms."""
    engine.reset()
    engine.process(given[:first])
    longest_ns = 0
    for k in range(first, len(given)):
        began_ns = time.process_time_ns()
        engine.process(given[k : k + 1])
        longest_ns = max(longest_ns, time.process_time_ns() - began_ns)
    return longest_ns / 1e6


def bench_judging(seeds: int = 5) -> dict[str, float]:
    """Most CPU time of one reading: of an honest car, and while its range finder is 0.2 m off; median of seeds, ms.

    Commands wait so long: what is decided about an alarm decides the next of them.
    """
    assembly = load(CONFIG.with_name(f"{NAME}_lqg.toml"))
    engine, longest = assembly.engine(), np.zeros((seeds, 2))
    for seed in range(seeds):
        given = records(assembly.layout, simulate(NAME, seed=seed, duration_s=15.0).readings)
        late = (given["sensor"] == assembly.layout.numbers["ultrasonic"]) & (given["t_ns"] > 10 * NANOSECONDS)
        longest[seed, 0] = longest_ms(engine, given, 5000)
        given["z"][late, 0] += 0.2
        longest[seed, 1] = longest_ms(engine, given, 5000)
    honest, lying = np.median(longest, axis=0).tolist()
    return {"honest_ms": honest, "lying_ms": lying}


if __name__ == "__main__":
    print(json.dumps(bench_command_age()))
