"""`fusiond config kinds`: every built-in model, sensor and control law, and what a configuration may say of one."""

from __future__ import annotations

import inspect
import json
from collections.abc import Mapping
from types import ModuleType

from rich.console import Console

from fusiond.cli.explaining import screen
from fusiond.cli.views import table_of
from fusiond.config import nearest
from fusiond.control.catalogue import LAWS
from fusiond.errors import ConfigError
from fusiond.models.catalogue import PROCESSES, SENSORS

SECTIONS: Mapping[str, Mapping[str, ModuleType]] = {
    "model": PROCESSES,
    "sensor.NAME": SENSORS,
    "control": LAWS,
}
"""Kinds by the section that names them."""


def show_kinds(kind: str | None) -> None:
    """All kinds, a line each, or one of them whole. Raises ConfigError where there is none of that name."""
    console = screen()
    if kind is None:
        _all(console)
        return
    found = {section: kinds[kind] for section, kinds in SECTIONS.items() if kind in kinds}
    if not found:
        known = [name for kinds in SECTIONS.values() for name in kinds]
        raise ConfigError(f"config kinds {kind}: there is none of that name; {nearest(kind, known)}")
    for section, module in found.items():
        for line in described(section, kind, module):
            console.print(line, markup=False, highlight=False)


def _all(console: Console) -> None:
    """A table: the section, the kind, the first line of what it is."""
    table = table_of("", "section", "kind", "what it is")
    for column in table.columns[1:]:
        column.justify = "left"
    for section, kinds in SECTIONS.items():
        for kind, module in sorted(kinds.items()):
            table.add_row(
                f"[{section}]".replace("[", r"\["), kind, (inspect.getdoc(module) or "").splitlines()[0]
            )
    console.print(table)


def described(section: str, kind: str, module: ModuleType) -> list[str]:
    """A section to fill in, its parameters with their defaults, and the words of the model itself."""
    tag = "law" if section == "control" else "kind"
    lines = [f"[{section}]", f'{tag} = "{kind}"']
    for name, parameter in inspect.signature(module.describe).parameters.items():
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY:
            lines.append(_line(name, parameter))
    return [*lines, "", inspect.getdoc(module) or "", "", inspect.getdoc(module.describe) or ""]


def _line(name: str, parameter: inspect.Parameter) -> str:
    """`name = default`; what has none is to be filled in, what may be left out stands behind a #."""
    if parameter.default is inspect.Parameter.empty:
        return f"{name} = ?  # {parameter.annotation}"
    if parameter.default is None:
        return f"# {name} = ?  # {parameter.annotation}".removesuffix(" | None")
    return f"{name} = {json.dumps(parameter.default)}"
