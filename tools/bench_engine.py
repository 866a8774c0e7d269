"""Measures the step, replay, starting and memory; each against a named peer in the same run where it has one."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.assembly import Assembly, assemble, load
from fusiond.config import parse
from fusiond.engine.engine import Engine
from fusiond.recording.log import open_log
from fusiond.recording.mcap_writer import McapWriter
from fusiond.recording.replay import replay
from fusiond.types import NANOSECONDS

PROJECT = Path(__file__).resolve().parents[1]
MINICAR = PROJECT / "configs" / "minicar.toml"
REPEATS = 7
READINGS = 20_000
MICROSECOND = 1e6


def rows_text(matrix: NDArray[np.float64]) -> str:
    """A matrix as TOML."""
    return json.dumps(matrix.tolist())


def linear_matrices(
    states: int, sensors: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """A stable, dense, discrete A (n, n), G = I, and H (sensors, 3, n), seeded."""
    rng = np.random.default_rng(0)
    A = rng.standard_normal((states, states))
    A *= 0.95 / np.max(np.abs(np.linalg.eigvals(A)))
    return A, np.eye(states), rng.standard_normal((sensors, 3, states))


def linear_assembly(states: int, sensors: int, bank: bool, watched: bool = False) -> Assembly:
    """A linear configuration with sensors of three numbers each, with or without its leave-one-out bank, every test."""
    A, G, H = linear_matrices(states, sensors)
    names = json.dumps([f"x{i}" for i in range(states)])
    stds = ", ".join(f"x{i} = 1.0" for i in range(states))
    lines = [
        'name = "bench"', "[model]", 'kind = "linear"', "step_s = 0.01", f"states = {names}",
        f"A = {rows_text(A)}", f"G = {rows_text(G)}", f"Q = {rows_text(0.01 * np.eye(states))}",
        "[initial]", f"std = {{ {stds} }}",
        "[filter]", f"leave_one_out = {str(bank).lower()}", "local_filters = false",
    ]  # fmt: skip
    for k in range(sensors):
        lines += [
            f"[sensor.s{k}]", 'kind = "linear"', f"H = {rows_text(H[k])}",
            "noise_std = { z0 = 1.0, z1 = 1.0, z2 = 1.0 }", f"rate_hz = {100.0 / sensors}",
        ]  # fmt: skip
    if watched:
        lines += ["[faults]"]
    return assemble(parse("\n".join(lines), "bench"))


def linear_readings(assembly: Assembly, sensors: int) -> NDArray[Any]:
    """Readings of all sensors in turn, one at each step."""
    layout = assembly.layout
    readings = np.zeros(READINGS, layout.reading)
    readings["t_ns"] = np.arange(READINGS) * 10_000_000
    readings["sensor"] = np.arange(READINGS) % sensors
    readings["length"] = 3
    readings["z"] = np.random.default_rng(1).standard_normal((READINGS, 3))
    return readings


def healthy_readings(assembly: Assembly, states: int, sensors: int) -> NDArray[Any]:
    """The same, of a state that moves as the model says: no test has anything to tell of."""
    A, _, H = linear_matrices(states, sensors)
    rng, x = np.random.default_rng(2), np.zeros(states)
    readings = linear_readings(assembly, sensors)
    for k in range(READINGS):
        readings["z"][k] = H[k % sensors] @ x + rng.standard_normal(3)
        x = A @ x + 0.1 * rng.standard_normal(states)
    return readings


def engine_us(engine: Engine, readings: NDArray[Any]) -> float:
    """Best time of a reading over several passes, us."""
    best = np.inf
    for _ in range(REPEATS):
        engine.reset()
        started = time.perf_counter()
        engine.process(readings)
        best = min(best, time.perf_counter() - started)
    return best / len(readings) * MICROSECOND


def filterpy_us(states: int, sensors: int) -> float:
    """Best time of FilterPy's bare predict and update on the same model, us."""
    from filterpy.kalman import KalmanFilter

    A, G, H = linear_matrices(states, sensors)
    peer = KalmanFilter(dim_x=states, dim_z=3)
    peer.F, peer.Q, peer.R = A, 0.01 * G @ G.T, np.eye(3)
    values = np.random.default_rng(1).standard_normal((2000, 3))
    best = np.inf
    for _ in range(REPEATS):
        started = time.perf_counter()
        for k, z in enumerate(values):
            peer.predict()
            peer.update(z, H=H[k % sensors])
        best = min(best, time.perf_counter() - started)
    return best / len(values) * MICROSECOND


def bench_step() -> dict[str, float]:
    """The whole step: five filters at 8 states and 4 sensors; one at 15 states, dense and strapdown; FilterPy. us."""
    five = linear_assembly(8, 4, bank=True)
    one = linear_assembly(15, 4, bank=False)
    watched = linear_assembly(8, 4, bank=True, watched=True)
    return {
        "watched_us": engine_us(watched.engine(), healthy_readings(watched, 8, 4)),
        "five_us": engine_us(five.engine(), linear_readings(five, 4)),
        "fifteen_us": engine_us(one.engine(), linear_readings(one, 4)),
        "flight_us": flight_engine_us(),
        "filterpy_us": filterpy_us(8, 4),
    }


def flight_engine_us() -> float:
    """The strapdown filter of configs/flight.toml alone, on a simulated flight of 60 s: IMU and all aiding. us."""
    from fusiond.simulation.flight import flight
    from tools.pages.trials import configured, records

    assembly = configured("flight", {"filter": {"leave_one_out": False, "local_filters": False}})
    assert len(assembly.layout.filters) == 1
    readings, _ = flight(0, 60 * NANOSECONDS)
    return engine_us(assembly.engine(), records(assembly.layout, sorted(readings, key=lambda one: one.t_ns)))


def bench_control(repeats: int = 25) -> dict[str, float]:
    """Readings of the mini car: no law, PD, LQG with integral action, 100 commands a second; us each, in turn.

    `lqg_more_us` is the median over pairs of runs, one after the other.
    """
    from fusiond.simulation.registry import simulate
    from tools.pages.trials import configured, records

    readings = simulate("minicar", seed=0, duration_s=20.0).readings
    chosen: dict[str, tuple[str, dict[str, Any]]] = {
        "none": ("minicar", {"control": None}), "pd": ("minicar", {}), "lqg": ("minicar_lqg", {}),
    }  # fmt: skip
    ready = []
    for config, changes in chosen.values():
        assembly = configured(config, changes)
        ready.append((assembly.engine(), records(assembly.layout, readings)))
    us = np.zeros((len(ready), repeats + 1))
    for k in range(repeats + 1):
        for number, (engine, given) in enumerate(ready):
            engine.reset()
            began = time.process_time()
            engine.process(given)
            us[number, k] = (time.process_time() - began) / len(given) * 1e6
    us = us[:, 1:]  # the first round also loads what is compiled
    found = {f"{name}_us": float(np.median(one)) for name, one in zip(chosen, us, strict=True)}
    return found | {"lqg_more_us": float(np.median(us[2] - us[0]))}


def minicar_log(folder: Path, duration_s: float) -> tuple[Path, Path]:
    """The mini car's log as CSV and as packed MCAP."""
    from fusiond.simulation.logs import write_log
    from fusiond.simulation.registry import simulate

    csv, mcap = folder / "minicar.csv", folder / "minicar.mcap"
    write_log(csv, simulate("minicar", 0, duration_s))
    layout = load(MINICAR).layout
    with McapWriter(mcap, layout) as writer:
        for chunk in open_log(csv, layout):
            writer.readings(chunk)
    return csv, mcap


def bench_replay(duration_s: float = 300.0) -> dict[str, float]:
    """Readings a second from file to result, CSV without --out and packed MCAP."""
    assembly = load(MINICAR)
    rates: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, log in zip(("csv", "mcap"), minicar_log(Path(folder), duration_s), strict=True):
            replay(assembly.engine(), open_log(log, assembly.layout))
            best = 0.0
            for _ in range(3):
                started = time.perf_counter()
                summary = replay(assembly.engine(), open_log(log, assembly.layout))
                best = max(best, summary.readings / (time.perf_counter() - started))
            rates[name] = best
    return rates


def repeated(block: NDArray[Any], times: int, period_ns: int) -> Iterator[NDArray[Any]]:
    """The block over and over, each time a period later."""
    for _ in range(times):
        yield block
        block["t_ns"] += period_ns


def bench_memory(readings: int = 10_000_000) -> dict[str, float]:
    """Growth of the resident size between a tenth and the whole of a long replay, MiB."""
    assembly = load(MINICAR)
    block = np.zeros(10_000, assembly.layout.reading)
    block["t_ns"] = np.arange(10_000) * 1_000_000
    block["sensor"] = assembly.layout.numbers["accelerometer"]
    block["sensor"][::30] = assembly.layout.numbers["ultrasonic"]
    block["length"] = 1
    sizes: list[float] = []
    count = readings // len(block)

    def watch(events: int) -> None:
        if events in {readings // 10, readings}:
            sizes.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)

    replay(assembly.engine(), repeated(block, count, 10_000_000_000), progress=watch)
    return {"growth_mib": sizes[-1] - sizes[0], "resident_mib": sizes[-1], "readings": float(readings)}


def first_estimate_s(cache: Path) -> float:
    """From starting `fusiond run` to the first estimate received over Zenoh, s."""
    from fusiond.service.client import EstimateSubscriber, SensorPublisher

    command = [sys.executable, "-m", "fusiond.cli", "run", str(MINICAR), "--listen", "tcp/127.0.0.1:0"]
    started = time.perf_counter()
    daemon = subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env=os.environ | {"FUSIOND_CACHE": str(cache)}
    )
    try:
        assert daemon.stdout is not None
        endpoint = daemon.stdout.readline().split()[1]
        with (
            EstimateSubscriber("minicar", endpoint) as estimates,
            SensorPublisher("minicar", "ultrasonic", endpoint) as sensor,
        ):
            sensor.wait_until_heard()
            sensor.publish([0.0])
            estimates.next(10.0)
        return time.perf_counter() - started
    finally:
        daemon.terminate()
        daemon.wait(10)


def bench_start() -> dict[str, float]:
    """Start to first estimate: with an empty cache, and with a filled one (best of three), s."""
    with tempfile.TemporaryDirectory() as folder:
        cold = first_estimate_s(Path(folder))
        return {"cold_s": cold, "warm_s": min(first_estimate_s(Path(folder)) for _ in range(3))}
