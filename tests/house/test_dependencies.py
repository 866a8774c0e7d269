"""What is declared is used, what is used is declared, and the lock pins all of it."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions, requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

PROJECT = Path(__file__).resolve().parents[2]
DECLARED = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
RUNTIME = [Requirement(line) for line in DECLARED["dependencies"]]
EXTRAS = {
    name: [Requirement(line) for line in lines] for name, lines in DECLARED["optional-dependencies"].items()
}
LOCK = (PROJECT / "requirements.lock").read_text(encoding="utf-8").splitlines()
LOCK_LINE = re.compile(r'(?P<name>[\w.-]+)==(?P<version>[\w.!+]+)(; python_version < "3\.\d+")?')


def imported(*folders: str) -> set[str]:
    """Top-level names imported anywhere under the project's folders, relative imports left out."""
    names: set[str] = set()
    for folder in folders:
        for path in (PROJECT / folder).rglob("*.py"):
            names |= imports_of(path.read_text(encoding="utf-8"))
    return names


def imports_of(source: str) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module.partition(".")[0])
    return names


def distributions_of(names: set[str]) -> set[str]:
    """The distributions that provide the imported names, as far as they are installed."""
    providers = packages_distributions()
    return {canonicalize_name(name) for module in names for name in providers.get(module, [module])}


def locked() -> dict[str, str]:
    found = [LOCK_LINE.fullmatch(line) for line in LOCK]
    return {canonicalize_name(match["name"]): match["version"] for match in found if match}


def test_imports_are_read_wherever_they_stand():
    source = "import os.path\nfrom a.b import c\nfrom . import d\ndef f():\n    import late\n"
    assert imports_of(source) == {"os", "a", "late"}


UNDECLARED_BY_OTHERS = {"networkx": "scikit-fuzzy", "packaging": "scikit-fuzzy"}
"""What a dependency imports without declaring it, and which one: declared here in its place."""


@pytest.mark.parametrize(("name", "by"), UNDECLARED_BY_OTHERS.items())
def test_what_others_forgot_to_declare_is_still_forgotten(name, by):
    """Once they declare it, it can go from ours."""
    needed = {canonicalize_name(Requirement(line).name) for line in requires(by) or ()}
    assert canonicalize_name(name) not in needed
    assert name in {r.name for r in RUNTIME}


@pytest.mark.parametrize("name", [r.name for r in RUNTIME if r.name not in UNDECLARED_BY_OTHERS])
def test_a_declared_dependency_is_imported(name):
    assert canonicalize_name(name) in distributions_of(imported("fusiond", "tools")), (
        f"pyproject.toml: {name} is declared, nothing in fusiond/ or tools/ imports it; use it or drop it"
    )


@pytest.mark.parametrize(
    ("folder", "extras"), [("fusiond", ("report",)), ("tools", ("test",)), ("tests", ("test",))]
)
def test_an_imported_package_is_declared(folder, extras):
    """The package needs its run-time dependencies, and `report` for pictures (the import contract "matplotlib" says
    where); tools and tests may use the oracles of `test`.
    """
    foreign = imported(folder) - sys.stdlib_module_names - {"fusiond", "tools", "tests", "packaging"}
    allowed = {canonicalize_name(r.name) for r in [*RUNTIME, *(r for extra in extras for r in EXTRAS[extra])]}
    assert distributions_of(foreign) <= allowed


@pytest.mark.parametrize("line", LOCK)
def test_the_lock_holds_exact_versions_and_no_addresses(line):
    assert LOCK_LINE.fullmatch(line)


@pytest.mark.parametrize("requirement", [*RUNTIME, *(r for extra in EXTRAS.values() for r in extra)], ids=str)
def test_the_lock_satisfies_what_is_declared(requirement):
    version = locked().get(canonicalize_name(requirement.name))
    assert version is not None, f"requirements.lock: {requirement.name} is missing; run `make lock`"
    assert requirement.specifier.contains(version), (
        f"requirements.lock: {requirement.name} {version}; `make lock`"
    )
