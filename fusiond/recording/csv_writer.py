"""Writing readings as a CSV log, exact in time and value."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.engine.records import HAS_ARRIVAL, HAS_SEQ
from fusiond.recording.decimal_time import seconds_text
from fusiond.types import EVENTS


def write_csv(path: Path, layout: Layout, chunks: Iterable[NDArray[Any]]) -> int:
    """Write readings and ticks as a CSV log that reads back bit for bit, but for an R that came with a
    reading.

    Columns `arrival_s` and `seq` are always there, empty where a reading has none. Returns how many rows it
    wrote.
    """
    names = {sensor.number: sensor.name for sensor in layout.sensors} | EVENTS
    payload, rows = layout.shape.payload, 0
    with path.open("w", encoding="utf-8") as file:
        file.write("t_s,sensor,arrival_s,seq," + ",".join(f"z{k}" for k in range(max(1, payload))) + "\n")
        for readings in chunks:
            file.writelines(row_text(reading, names) for reading in readings)
            rows += len(readings)
    return rows


def row_text(reading: Any, names: dict[int, str]) -> str:
    """One reading as a line of the log."""
    flags = int(reading["flags"])
    arrival = seconds_text(reading["arrival_ns"]) if flags & HAS_ARRIVAL else ""
    seq = str(int(reading["seq"])) if flags & HAS_SEQ else ""
    z = [repr(float(value)) for value in reading["z"][: int(reading["length"])]]
    return ",".join([seconds_text(reading["t_ns"]), names[int(reading["sensor"])], arrival, seq, *z]) + "\n"
