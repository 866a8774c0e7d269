"""The sections of built-in models, sensors and control laws, made from what each kind's `describe` takes.

So a new kind needs no line here. Names carry units; a number's bounds follow from its name.
"""

from __future__ import annotations

import inspect
import re
import typing
from collections.abc import Mapping
from types import ModuleType
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union

from pydantic import ConfigDict, Discriminator, Tag, create_model

from fusiond.config.sections import (
    ControlSection,
    Finite,
    InputSection,
    ModelSection,
    NotNegative,
    Positive,
    Section,
    SensorSection,
)
from fusiond.control.catalogue import LAWS
from fusiond.models.catalogue import PROCESSES, SENSORS


def _hints(function: Any) -> dict[str, Any]:
    """Annotations of a function, evaluated."""
    return typing.get_type_hints(function)


NEVER_NEGATIVE = re.compile(r"(^|_)(noise|std)_|_std$")
ABOVE_ZERO = re.compile(r"^(mass|yaw_inertia|track|stiffness|max_step|limit|unwinding)_|_time_s$")


def _bounded(name: str, hint: Any) -> Any:
    """The type of a built-in kind's parameter: a number is finite, and by its name never negative, or above zero."""
    if hint is not float:
        return hint
    if ABOVE_ZERO.search(name):
        return Positive
    return NotNegative if NEVER_NEGATIVE.search(name) else Finite


def _section(base: type[Section], tag: str, kind: str, module: ModuleType) -> type[Section]:
    """The section of one built-in kind: `base`, its tag, and the keyword arguments of its `describe`."""
    hints = _hints(module.describe)
    fields: dict[str, Any] = {tag: (Literal[kind], ...)}
    for name, parameter in inspect.signature(module.describe).parameters.items():
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY:
            default = ... if parameter.default is inspect.Parameter.empty else parameter.default
            fields[name] = (_bounded(name, hints[name]), default)
    title = f"{base.__name__.removesuffix('Section')}_{kind}"
    return create_model(title, __base__=base, __doc__=module.__doc__, **fields)


class UserModelSection(ModelSection):
    """A process model in a file of your own; its parameters are judged by its `describe`."""

    model_config = ConfigDict(extra="allow")
    file: str
    """Path of the Python file, relative to the configuration."""


class UserSensorSection(SensorSection):
    """A sensor model in a file of your own; its parameters are judged by its `describe`."""

    model_config = ConfigDict(extra="allow")
    file: str
    """Path of the Python file, relative to the configuration."""


PROCESS_SECTIONS = {kind: _section(ModelSection, "kind", kind, module) for kind, module in PROCESSES.items()}
SENSOR_SECTIONS = {kind: _section(SensorSection, "kind", kind, module) for kind, module in SENSORS.items()}
LAW_SECTIONS = {law: _section(ControlSection, "law", law, module) for law, module in LAWS.items()}


def _one_of(tag: str, sections: Mapping[str, type[Section]]) -> Any:
    """A union of sections chosen by the value of `tag`, or by the presence of `file`."""

    def choose(value: Any) -> str:
        if not isinstance(value, dict):
            return str(getattr(value, tag, "file"))
        return "file" if "file" in value and tag not in value else str(value.get(tag))

    members = tuple(Annotated[section, Tag(kind)] for kind, section in sections.items())
    return Annotated[Union[members], Discriminator(choose)]  # noqa: UP007 (members are known at run time only)


if TYPE_CHECKING:
    AnyModel = ModelSection
    AnySensor = SensorSection
    AnyControl = ControlSection
else:
    AnyModel = _one_of("kind", PROCESS_SECTIONS | {"file": UserModelSection})
    AnySensor = _one_of("kind", SENSOR_SECTIONS | {"input": InputSection, "file": UserSensorSection})
    AnyControl = _one_of("law", LAW_SECTIONS)


OWN_FIELDS = {
    "model": frozenset({"kind", "file"}),
    "sensor": frozenset(InputSection.model_fields) | frozenset({"kind", "file"}),
    "control": frozenset({"law"}) | frozenset(ControlSection.model_fields),
}
"""Fields of a section that are not parameters of its kind."""


def parameters(section: Section, part: str) -> dict[str, Any]:
    """The parameters of a model, sensor or law: everything in its section that is not the section's own.

    Args:
        part: `model`, `sensor` or `control`.
    """
    return {name: value for name, value in section if name not in OWN_FIELDS[part]}
