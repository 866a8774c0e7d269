"""When readings arrive: each sensor's delay, fixed and random, turns stamp order into arrival order.

The stamps and values stay as they are: a late reading is no lie.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fusiond.simulation.streams import stream
from fusiond.simulation.tables import Reading, Times
from fusiond.types import nanoseconds

PerSensor = float | Mapping[str, float]


def of_sensor(setting: PerSensor, sensor: str) -> float:
    """One number for every sensor, or one for each that is named (0 for the others)."""
    return setting.get(sensor, 0.0) if isinstance(setting, Mapping) else setting


DRIVING = frozenset({"accelerometer", "applied", "speed"})
"""Sensors that tell what moved the plant up to their stamp; at equal stamps they are read before the others."""


def stamp_order(reading: Reading) -> tuple[int, bool, str]:
    """The order in which readings are taken: by stamp, what drives first, then by name."""
    return reading.t_ns, reading.sensor not in DRIVING, reading.sensor


def arrive(
    readings: list[Reading], seed: int, delay_s: PerSensor, jitter_s: PerSensor
) -> tuple[tuple[Reading, ...], Times]:
    """Readings and arrival times in the order of arrival.

    Each arrives delay + uniform(0, jitter) after its stamp, independently, so readings of one sensor may
    overtake each other too, and none is later than delay + jitter. Equal arrivals keep the order of the
    stamps, then what drives first, then of the names.
    """
    ordered = sorted(readings, key=stamp_order)
    rng = {name: stream(seed, f"arrival/{name}") for name in {reading.sensor for reading in ordered}}
    late_ns = [
        nanoseconds(of_sensor(delay_s, reading.sensor))
        + int(rng[reading.sensor].random() * nanoseconds(of_sensor(jitter_s, reading.sensor)))
        for reading in ordered
    ]
    stamps_ns = np.array([reading.t_ns for reading in ordered], dtype=np.int64)
    arrivals_ns = stamps_ns + np.array(late_ns, dtype=np.int64)
    order = np.argsort(arrivals_ns, kind="stable")
    return tuple(ordered[index] for index in order), arrivals_ns[order]
