"""Control of a configuration: the tables of its command, and the times that belong to it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fusiond.assembly.resolve import Resolved, by_key
from fusiond.config import ControlSection
from fusiond.control.contract import Law
from fusiond.control.levels import Safe
from fusiond.errors import ConfigError
from fusiond.types import NANOSECONDS, Role, nanoseconds

SHORTEST_SILENCE_S = 0.1
ACKNOWLEDGED_PERIODS = 3.0
"""Periods of commands for which an acknowledgement stands, where `applied` says nothing of its rate."""


def feeding_sensor(resolved: Resolved) -> int:
    """Number of the sensor whose reading a command is; -1 where the command drives nothing."""
    if resolved.law is None or not resolved.law.drives:
        return -1
    for number, sensor in enumerate(resolved.sensors):
        if sensor.name == "applied" and sensor.role is Role.INPUT:
            return number
    return -1


def longest_wait_s(section: ControlSection) -> float:
    """How long a due command waits for the readings of its moment."""
    return 0.5 / section.rate_hz if section.wait_s is None else section.wait_s


def command_deadline_s(section: ControlSection, tick_hz: float) -> float:
    """Time without a command after which the service says that its loop is late."""
    if section.deadline_s is not None:
        return section.deadline_s
    return max(5.0 / section.rate_hz, 5.0 / tick_hz, longest_wait_s(section), 0.25)


def _of_controls(said: Mapping[str, float], law: Law, name: str, missing: float) -> list[float]:
    """One number for each control; raises ConfigError for a key that is none."""
    values = by_key(said, law.controls, f"control.{name}")
    return [float(values.get(slot.name, missing)) for slot in law.controls]


def fill_control(resolved: Resolved, record: np.record) -> None:
    """The command's tables in the design record; without control its period is never read. Raises ConfigError."""
    law, section = resolved.law, resolved.config.control
    record["control_period_ns"] = NANOSECONDS
    record["largest_std"] = np.inf
    record["feeds"] = feeding_sensor(resolved)
    if law is None or section is None:
        return
    places = {slot.name: place for place, slot in enumerate(resolved.process.states)}
    record["control_period_ns"] = nanoseconds(1.0 / section.rate_hz)
    record["c"][: len(law.parameters)] = law.parameters
    record["law_at"][: len(law.reads)] = [places[name] for name in law.reads]
    record["lowest"] = _of_controls(section.lowest, law, "lowest", -np.inf)
    record["highest"] = _of_controls(section.highest, law, "highest", np.inf)
    if not np.all(record["lowest"] <= record["highest"]):
        raise ConfigError("control.lowest: is above control.highest; exchange them")
    slew = {key.removesuffix("_s"): value for key, value in section.slew.items()}
    record["slew"] = _of_controls(slew, law, "slew", np.inf)
    record["safe_command"] = _of_controls(section.safe_command, law, "safe_command", 0.0)
    record["safe_mode"] = Safe[section.safe.upper()]
    record["safe_ramp_ns"] = nanoseconds(section.safe_ramp_s)
    record["fade_ns"] = nanoseconds(section.fade_s)
    forever = section.dead_reckoning_s is None
    record["reckoning_ns"] = (
        np.iinfo(np.int64).max if forever else nanoseconds(section.dead_reckoning_s or 0.0)
    )
    largest = by_key(section.largest_std, resolved.process.error_slots, "control.largest_std")
    record["largest_std"] = [largest.get(slot.name, np.inf) for slot in resolved.process.error_slots]
    _fill_waiting(resolved, section, record)
    record["cost_share"] = min(1.0, 1.0 / (section.cost_time_s * section.rate_hz))
    record["acknowledged_ns"] = _acknowledged_ns(resolved, section)


def _fill_waiting(resolved: Resolved, section: ControlSection, record: np.record) -> None:
    names = [sensor.name for sensor in resolved.sensors]
    for name in section.waits_for:
        if name not in names:
            raise ConfigError(f"control.waits_for: no sensor `{name}`; choose from {', '.join(names)}")
        record["awaited"][names.index(name)] = 1
    record["command_wait_ns"] = nanoseconds(longest_wait_s(section)) if section.waits_for else 0


def _acknowledged_ns(resolved: Resolved, section: ControlSection) -> int:
    said = resolved.config.sensor.get("applied")
    rate_hz = said.rate_hz if said is not None and said.rate_hz else section.rate_hz
    return nanoseconds(max(ACKNOWLEDGED_PERIODS / rate_hz, SHORTEST_SILENCE_S))
