"""Every setting is documented where an operator looks: in the schema, or in the docstring of its kind."""

from __future__ import annotations

import inspect
from pathlib import Path

import pytest
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from fusiond.config import kinds, read, sections, whole
from fusiond.config.sections import Section
from fusiond.control.catalogue import LAWS
from fusiond.models.catalogue import PROCESSES, SENSORS

CONFIGS = sorted((Path(__file__).resolve().parents[2] / "configs").glob("*.toml"))
KINDS = {
    f"{part}.{kind}": module
    for part, modules in {"model": PROCESSES, "sensor": SENSORS, "control": LAWS}.items()
    for kind, module in modules.items()
}


def undocumented(section: type[BaseModel]) -> list[str]:
    """Fields of a section without a description; a field that is itself a section has that of its class."""
    fields = section.model_fields.items()
    return [name for name, field in fields if not (field.description or is_section(field))]


def is_section(field: FieldInfo) -> bool:
    return inspect.isclass(field.annotation) and issubclass(field.annotation, Section)


def written() -> list[type[Section]]:
    """The sections written out; those made from a kind's `describe` are judged by its docstring."""
    found = {
        value for room in (sections, kinds, whole) for value in vars(room).values() if inspect.isclass(value)
    }
    return sorted((one for one in found if issubclass(one, Section)), key=lambda one: one.__name__)


@pytest.mark.parametrize("section", written(), ids=lambda section: section.__name__)
def test_a_setting_has_a_description(section):
    assert undocumented(section) == []


@pytest.mark.parametrize("kind", KINDS)
def test_a_parameter_of_a_kind_stands_in_its_docstring(kind):
    describe = KINDS[kind].describe
    text = f"{inspect.getdoc(KINDS[kind])}\n{inspect.getdoc(describe)}"
    names = [p.name for p in inspect.signature(describe).parameters.values() if p.kind is p.KEYWORD_ONLY]
    assert [name for name in names if name not in text] == []


def test_a_bare_setting_is_seen():
    class Bare(BaseModel):
        told: int = 1
        """Something."""

    assert undocumented(Bare) == [
        "told"
    ]  # pydantic reads the docstring only where the base class asks for it


@pytest.mark.parametrize("path", CONFIGS, ids=lambda path: path.stem)
def test_a_config_of_the_project_is_well_formed(path):
    """Named like its file, so that the demo and the keys find it."""
    assert read(path).name == path.stem
