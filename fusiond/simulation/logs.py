"""Simulations as CSV: the log (`t_s,sensor,z0,z1,...`, rows in arrival order) and the truth (`t_s,name,...`).

Times are exact decimals of whole nanoseconds; values are the shortest decimals that read back to the same
float.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from fusiond.simulation.tables import Simulation, Truth
from fusiond.types import NANOSECONDS


def decimal_seconds(t_ns: int) -> str:
    """1500000000 -> "1.5": exact, at least one decimal, no exponent."""
    whole, rest = divmod(abs(t_ns), NANOSECONDS)
    return f"{'-' if t_ns < 0 else ''}{whole}.{f'{rest:09d}'.rstrip('0') or '0'}"


def log_lines(simulation: Simulation) -> Iterator[str]:
    """The log's lines. The column `arrival_s` is there only where something arrives after its stamp."""
    stamps_ns = np.array([reading.t_ns for reading in simulation.readings], dtype=np.int64)
    late = bool(np.any(stamps_ns != simulation.arrivals_ns))
    width = max((len(reading.z) for reading in simulation.readings), default=1)
    channels = [f"z{channel}" for channel in range(width)]
    yield ",".join(["t_s", "sensor", *(["arrival_s"] if late else []), *channels])
    for reading, arrival_ns in zip(simulation.readings, simulation.arrivals_ns.tolist(), strict=True):
        arrival = [decimal_seconds(arrival_ns)] if late else []
        yield ",".join([decimal_seconds(reading.t_ns), reading.sensor, *arrival, *map(repr, reading.z)])


def truth_lines(truth: Truth) -> Iterator[str]:
    """The truth's lines."""
    yield ",".join(["t_s", *truth.names])
    for t_ns, row in zip(truth.t_ns.tolist(), truth.values.tolist(), strict=True):
        yield ",".join([decimal_seconds(t_ns), *map(repr, row)])


def write_lines(path: Path, lines: Iterator[str]) -> None:
    """Write text lines; raises OSError when the path cannot be written."""
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.writelines(line + "\n" for line in lines)


def write_log(path: Path, simulation: Simulation) -> None:
    """Write the log of a simulation."""
    write_lines(path, log_lines(simulation))


def write_truth(path: Path, truth: Truth) -> None:
    """Write the truth of a simulation."""
    write_lines(path, truth_lines(truth))
