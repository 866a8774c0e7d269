"""From what an operator said to what the models mean: every section met with its model, every name looked up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.modules import described, require, user_module
from fusiond.assembly.motion import setting_of
from fusiond.config import Config, InputSection, SensorSection, nearest, parameters
from fusiond.control.catalogue import LAWS
from fusiond.control.contract import Law
from fusiond.errors import ConfigError
from fusiond.models.catalogue import PROCESSES, SENSORS
from fusiond.models.contract import Process, Sensor
from fusiond.types import Hold, Role, Slot

Matrix = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ResolvedSensor:
    """One sensor with its model.

    Args:
        section: what the operator said; None for `applied` and `reference` of a controller.
        module: its model file, None where it has none (it drives the prediction or feeds the controller).
        R: (dof, dof) covariance of its measured channels, squared units.   drives: numbers of the inputs it sets.
    """

    name: str
    role: Role
    model: Sensor
    module: ModuleType | None
    section: SensorSection | None
    R: Matrix
    drives: tuple[int, ...] = ()
    hold: Hold = Hold.NEXT


@dataclass(frozen=True, slots=True)
class Resolved:
    """A configuration with its models. `sensors` are in the order of their numbers."""

    config: Config
    process: Process
    process_module: ModuleType
    sensors: tuple[ResolvedSensor, ...]
    law: Law | None
    law_module: ModuleType | None

    @property
    def updating(self) -> tuple[ResolvedSensor, ...]:
        """The sensors that correct the state."""
        return tuple(sensor for sensor in self.sensors if sensor.role is Role.UPDATE)


def by_key(values: Mapping[str, Any], slots: tuple[Slot, ...], subject: str) -> dict[str, Any]:
    """Values keyed by slot name instead of name with unit; raises ConfigError for a key that is no slot."""
    names = {slot.key: slot.name for slot in slots}
    for key in values:
        if key not in names:
            raise ConfigError(f"{subject}: unknown `{key}`; {nearest(key, names)}")
    return {names[key]: value for key, value in values.items()}


def require_all(values: Mapping[str, Any], slots: tuple[Slot, ...], subject: str, remedy: str) -> None:
    """Raise ConfigError that names every slot without a value."""
    missing = [f"`{slot.key}`" for slot in slots if slot.name not in values]
    if missing:
        verb = "is" if len(missing) == 1 else "are"
        raise ConfigError(f"{subject}: {', '.join(missing)} {verb} missing; {remedy}")


def _noise(section: SensorSection, channels: tuple[Slot, ...], subject: str) -> Matrix:
    """Covariance of the measured channels from noise_std or noise_covariance."""
    if section.noise_covariance is not None:
        R = np.array(section.noise_covariance, dtype=float)
        if section.noise_std:
            raise ConfigError(f"{subject}: has noise_std and noise_covariance; keep one of them")
        if R.shape != (len(channels), len(channels)) or not np.array_equal(R, R.T):
            size = f"{len(channels)} x {len(channels)}"
            raise ConfigError(
                f"{subject}.noise_covariance: is not symmetric {size}; one row a measured channel"
            )
        if np.linalg.eigvalsh(R)[0] < -1e-12 * np.trace(R):
            raise ConfigError(
                f"{subject}.noise_covariance: has a negative eigenvalue; check its numbers, or give noise_std"
            )
        return R
    stds = by_key(section.noise_std, channels, f"{subject}.noise_std")
    require_all(stds, channels, f"{subject}.noise_std", "give each channel's deviation")
    return np.diag([stds[slot.name] ** 2 for slot in channels])


def _input(name: str, section: InputSection, process: Process) -> ResolvedSensor:
    """A sensor that drives the prediction."""
    subject = f"sensor.{name}"
    if not section.drives:
        raise ConfigError(f"{subject}.drives: names no input; name what its numbers set, or drop the sensor")
    known = {slot.name: number for number, slot in enumerate(process.inputs)}
    for driven in section.drives:
        if driven not in known:
            what = nearest(driven, known) if known else "this model has no inputs"
            raise ConfigError(f"{subject}.drives: the process model has no input `{driven}`; {what}")
    drives = tuple(known[driven] for driven in section.drives)
    channels = tuple(process.inputs[number] for number in drives)
    model = Sensor(channels=channels, reads=())
    R = _noise(section, channels, subject)
    return ResolvedSensor(name, Role.INPUT, model, None, section, R, drives, Hold[section.hold.upper()])


def _update(name: str, section: SensorSection, process: Process, folder: Path) -> ResolvedSensor:
    """A sensor that corrects the state."""
    subject = f"sensor.{name}"
    said: Any = section
    kind = getattr(said, "kind", None)
    module = SENSORS[kind] if kind else user_module(said.file, folder, subject)
    model: Sensor = described(module, (process,), parameters(section, "sensor"), subject)
    require(module, ("observe",), subject)
    for slot in model.reads:
        try:
            process.slot(slot)
        except ConfigError as error:
            raise ConfigError(
                f"{subject}: {error}; choose another kind of sensor or another model"
            ) from error
    R = _noise(section, model.channels[: model.dof], subject)
    return ResolvedSensor(name, Role.UPDATE, model, module, section, R)


def _controller_sensors(law: Law | None, process: Process, taken: Mapping[str, Any]) -> list[ResolvedSensor]:
    """`applied` and `reference`, where there is a controller and no sensor of that name.

    Where the command drives the prediction, `applied` is an input, and known exactly.
    """
    if law is None:
        return []
    numbers = {slot.name: number for number, slot in enumerate(process.inputs)}
    drives = tuple(numbers[slot.name] for slot in law.controls) if law.drives else ()
    applied = Role.INPUT if law.drives else Role.APPLIED
    both = (("applied", applied, law.controls, drives), ("reference", Role.REFERENCE, law.references, ()))
    return [
        ResolvedSensor(name, role, Sensor(slots, ()), None, None, np.zeros((len(slots), len(slots))), moved)
        for name, role, slots, moved in both
        if name not in taken and slots
    ]


def _no_input_left_alone(process: Process, sensors: list[ResolvedSensor]) -> None:
    """Every input of the process model is driven, by one sensor."""
    drivers: dict[int, str] = {}
    for sensor in sensors:
        for number in sensor.drives:
            if number in drivers:
                driven = process.inputs[number].name
                raise ConfigError(
                    f"sensor.{sensor.name}.drives: {drivers[number]} drives `{driven}` too; leave it to one of them"
                )
            drivers[number] = sensor.name
    for number, slot in enumerate(process.inputs):
        if number not in drivers:
            raise ConfigError(
                f"model: nothing drives its input `{slot.name}`; add a sensor with "
                f'kind = "input" and drives = ["{slot.name}"]'
            )


def resolve(config: Config, folder: Path) -> Resolved:
    """Meet every section with its model; raises ConfigError.

    Args:
        folder: where the configuration lies; a user's model files are relative to it.
    """
    said: Any = config.model
    kind = getattr(said, "kind", None)
    module = PROCESSES[kind] if kind else user_module(said.file, folder, "model")
    process: Process = described(module, (), parameters(said, "model"), "model")
    require(module, ("discretise",) if process.linear else ("transition", "noise"), "model")
    if process.errors:
        require(module, ("add_error", "error_between"), "model")
    if process.turning is not None and process.turning.follows:
        require(module, ("turn_error",), "model")
    law, law_module = None, None
    if config.control is not None:
        chosen: Any = config.control
        law_module = LAWS[chosen.law]
        setting = setting_of(process, module, config.control.rate_hz)
        law = described(law_module, (process, setting), parameters(chosen, "control"), "control")
        by_key(config.control.reference, law.references, "control.reference")
    sensors = _controller_sensors(law, process, config.sensor)
    for name, section in config.sensor.items():
        if isinstance(section, InputSection):
            sensors.append(_input(name, section, process))
        else:
            sensors.append(_update(name, section, process, folder))
    _no_input_left_alone(process, sensors)
    if not any(sensor.role is Role.UPDATE for sensor in sensors):
        raise ConfigError("sensor: none corrects the state; add at least one whose kind is not `input`")
    sensors.sort(key=lambda sensor: (sensor.role is Role.UPDATE, sensor.name))
    return Resolved(config, process, module, tuple(sensors), law, law_module)
