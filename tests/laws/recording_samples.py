"""Layouts and readings that the tests of recordings share."""

from __future__ import annotations

import numpy as np

from fusiond.engine.layout import Layout, SensorLayout
from fusiond.engine.records import HAS_ARRIVAL, HAS_R, HAS_SEQ, Shape
from fusiond.types import TICK, Role, Slot

CHANNELS = {"gps": ("x", "y"), "imu": ("yaw", "yaw_rate", "bias"), "speed": ("speed",)}


def layout_of(*names: str, payload: int = 3) -> Layout:
    """A two-state layout with these sensors, numbered in this order."""
    sensors = tuple(
        SensorLayout(name, number, Role.UPDATE, tuple(Slot(c, "m") for c in CHANNELS[name]))
        for number, name in enumerate(names)
    )
    shape = Shape(
        states=2, errors=2, inputs=0, noises=1, sensors=len(names), filters=1, payload=payload, slots=2,
        model_parameters=0, sensor_parameters=0, law_parameters=0, controls=0, references=0,
    )  # fmt: skip
    states = (Slot("position", "m"), Slot("heading", "rad"))
    return Layout("sample", states, states, (), (), (), (), sensors, (), shape)


def readings_of(layout: Layout, count: int, seed: int = 0, *, ticks: bool = True, covariances: bool = False):
    """Readings of every kind: with and without seq, arrival and R, late, non-finite, too short and too long."""
    rng = np.random.default_rng(seed)
    out = np.zeros(count, layout.reading)
    payload = layout.shape.payload
    for k in range(count):
        reading = out[k]
        reading["t_ns"] = 1_700_000_000_000_000_000 + k * 10_000_000 + int(rng.integers(-(10**8), 10**8))
        if ticks and rng.random() < 0.1:
            reading["sensor"] = TICK
            reading["flags"] = HAS_ARRIVAL
            reading["arrival_ns"] = reading["t_ns"]
            continue
        reading["sensor"] = rng.integers(len(layout.sensors))
        reading["length"] = rng.integers(1, payload + 1)
        z = rng.normal(size=payload) * 10.0 ** rng.integers(-12, 12, payload)
        z[rng.random(payload) < 0.05] = rng.choice([np.nan, np.inf, -np.inf, -0.0])
        reading["z"][: reading["length"]] = z[: reading["length"]]
        if rng.random() < 0.5:
            reading["flags"] |= HAS_SEQ
            reading["seq"] = rng.integers(2**63, dtype=np.uint64) * np.uint64(2)
        if rng.random() < 0.5:
            reading["flags"] |= HAS_ARRIVAL
            reading["arrival_ns"] = reading["t_ns"] + rng.integers(10**7)
        if covariances and rng.random() < 0.3:
            reading["flags"] |= HAS_R
            n = int(reading["length"])
            reading["R"][:n, :n] = rng.normal(size=(n, n))
    return out


def joined(log):
    """All chunks of a log as one array."""
    return np.concatenate([np.zeros(0, log.layout.reading), *log])
