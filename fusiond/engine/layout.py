"""What one configuration's records mean: names, units and numbers of states, sensors and controls."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from fusiond.engine.plain.records import plain_track_dtype
from fusiond.engine.records import Shape, desk_dtype, reading_dtype, report_dtype, track_dtype
from fusiond.types import Role, Slot


@dataclass(frozen=True, slots=True)
class SensorLayout:
    """One sensor as the records know it.

    Args:
        number: its place in every per-sensor array; inputs come first, then by name, which is also the order in
            which readings with equal stamps are processed.
        channels: the numbers of one reading, with units, an index (a beacon's number) included.
    """

    name: str
    number: int
    role: Role
    channels: tuple[Slot, ...]


@dataclass(frozen=True, slots=True)
class FilterLayout:
    """One filter of the bank, a row of the track's x, U and d.

    Args:
        hears: `all` sensors (row 0, the centralized filter), all but one (`without`), or one alone (`only`); or it is
            a part of row 0 (`level`: for some levels of the noise of its only sensor), which updates it.
        sensor: the one left out or heard alone; empty for `all`.
    """

    hears: Literal["all", "without", "only", "level"]
    sensor: str = ""

    def hears_sensor(self, name: str) -> bool:
        """Whether an updating sensor corrects this filter; inputs drive every filter."""
        if self.hears == "level":
            return False
        return self.hears == "all" or (self.sensor == name) == (self.hears == "only")


@dataclass(frozen=True)
class Layout:
    """Names for every number in the records of one configuration.

    Args:
        states, errors: numbers of x, and of its error; equal where the state is a vector.
        filters: the bank, row by row.
        controls, references: numbers of a command, and of the reference it follows.
        outputs: what the process model derives from its state (`vx`, `vy`), in the order of `Engine.outputs`.
        topology: how a plain step fuses (`fusiond.engine.plain`); empty where the step is compiled.
        protected: error slots with a protection level in every report.
    """

    name: str
    states: tuple[Slot, ...]
    errors: tuple[Slot, ...]
    outputs: tuple[Slot, ...]
    inputs: tuple[Slot, ...]
    controls: tuple[Slot, ...]
    references: tuple[Slot, ...]
    sensors: tuple[SensorLayout, ...]
    filters: tuple[FilterLayout, ...]
    shape: Shape
    topology: str = ""
    protected: tuple[Slot, ...] = ()

    @property
    def plain(self) -> bool:
        """Whether the track holds whole covariances, as the seeds' recursions and other topologies need."""
        return bool(self.topology)

    @cached_property
    def reading(self) -> np.dtype[Any]:
        """dtype of one reading."""
        return reading_dtype(self.shape.payload)

    @cached_property
    def report(self) -> np.dtype[Any]:
        """dtype of one report."""
        return report_dtype(self.shape)

    @cached_property
    def track(self) -> np.dtype[Any]:
        """dtype of the track."""
        return plain_track_dtype(self.shape) if self.plain else track_dtype(self.shape)

    @cached_property
    def desk(self) -> np.dtype[Any]:
        """dtype of the desk."""
        return desk_dtype(self.shape)

    @cached_property
    def numbers(self) -> dict[str, int]:
        """Sensor number by name."""
        return {sensor.name: sensor.number for sensor in self.sensors}

    def named(self, bits: int) -> list[str]:
        """Names of the error slots whose bits are set."""
        return [slot.name for j, slot in enumerate(self.errors) if bits >> j & 1] if bits else []

    def sensor(self, name: str) -> SensorLayout | None:
        """The sensor of that name, None where the configuration has none."""
        number = self.numbers.get(name)
        return None if number is None else self.sensors[number]
