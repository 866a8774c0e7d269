"""Control of a configuration: the tables of its command, and the times that belong to it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fusiond.assembly.resolve import Resolved, by_key
from fusiond.config import ControlSection
from fusiond.control.contract import Law
from fusiond.control.levels import Safe
from fusiond.errors import ConfigError
from fusiond.numerics.riccati import generator
from fusiond.types import NANOSECONDS, Role, nanoseconds

SHORTEST_SILENCE_S = 0.1
ROOM = 4
ACKNOWLEDGED_PERIODS = 3.0
"""Periods of commands for which an acknowledgement stands, where `applied` says nothing of its rate."""


def queue_room(commands: int) -> int:
    """Room for commands that have not acted yet: laws that differ only in a short delay share one compiled step."""
    return ROOM * max(1, -(-commands // ROOM))


def feeding_sensor(resolved: Resolved) -> int:
    """Number of the sensor whose reading a command is; -1 where the command drives and replaces nothing."""
    law, section = resolved.law, resolved.config.control
    if law is None or section is None or not (law.drives or stands_in(resolved)):
        return -1
    wanted = Role.INPUT if law.drives else Role.APPLIED
    for number, sensor in enumerate(resolved.sensors):
        if sensor.name == "applied" and sensor.role is wanted:
            return number
    return -1


def stands_in(resolved: Resolved) -> bool:
    """Whether the command stands in for an input; without [faults] no input is ever found to be out."""
    section = resolved.config.control
    return section is not None and section.stand_in is not None and resolved.config.faults is not None


def fill_stand_in(resolved: Resolved, record: np.record) -> None:
    """What the command stands in for: that input is gain times the command, plus offset. Raises ConfigError."""
    law, section = resolved.law, resolved.config.control
    if law is None or section is None or section.stand_in is None or not stands_in(resolved):
        return
    told, plan = section.stand_in, law.plan
    names = [sensor.name for sensor in resolved.sensors]
    if plan is None or law.drives:
        raise ConfigError("control.stand_in: needs a law with a plant of its own (A and B); leave it out")
    said = resolved.config.sensor.get(told.sensor)
    if (
        not getattr(said, "without_input_std", None)
        or len(resolved.sensors[names.index(told.sensor)].drives) != 1
    ):
        raise ConfigError(
            f"control.stand_in.sensor: `{told.sensor}` is no input of one number with `without_input_std`; name one"
        )
    if told.rate_of not in plan.states:
        raise ConfigError(
            f"control.stand_in.rate_of: `{told.rate_of}` is no state of the plant; choose from {', '.join(plan.states)}"
        )
    F, B = plan.plant.bare
    row = generator(F, B, plan.plant.period_s)[1][plan.states.index(told.rate_of)]
    n = plan.plant.states
    record["stands_for"] = names.index(told.sensor)
    record["stand_gain"][: len(row)] = row
    record["stand_offset"] = -float(row @ plan.targets[n:, -1])
    if told.plus is not None:
        record["stand_plus"] = [s.name for s in resolved.process.states].index(
            resolved.process.slot(told.plus).name
        )


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
    record["stands_for"] = record["stand_plus"] = -1
    if law is None or section is None:
        return
    places = {slot.name: place for place, slot in enumerate(resolved.process.states)}
    record["control_period_ns"] = nanoseconds(1.0 / section.rate_hz)
    record["queue"] = law.queue
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
    record["reckoning_ns"] = _patience(section.dead_reckoning_s)
    record["doubt_ns"] = _patience(section.doubt_s)
    largest = by_key(section.largest_std, resolved.process.error_slots, "control.largest_std")
    record["largest_std"] = [largest.get(slot.name, np.inf) for slot in resolved.process.error_slots]
    _fill_waiting(resolved, section, record)
    record["cost_share"] = min(1.0, 1.0 / (section.cost_time_s * section.rate_hz))
    fill_stand_in(resolved, record)
    record["acknowledged_ns"] = _acknowledged_ns(resolved, section)


def _patience(said_s: float | None) -> int:
    """Nanoseconds, without end where nothing is said."""
    return np.iinfo(np.int64).max if said_s is None else nanoseconds(said_s)


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
