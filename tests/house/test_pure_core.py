"""Below `assembly` no randomness, file or print, also where it needs no import of its own.

The import contracts keep out modules; this keeps out what comes with the builtins and with numpy.
"""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "fusiond"
ROOMS = ["numerics", "models", "filters", "fusion", "faults", "adapt", "control", "engine"]
CORE = sorted([*(path for room in ROOMS for path in (PACKAGE / room).rglob("*.py")), PACKAGE / "types.py"])
BUILTINS = {"open", "print", "input", "exec", "eval", "__import__"}
OF_NUMPY = {"random", "load", "loadtxt", "save", "savez", "savetxt", "fromfile", "genfromtxt", "memmap"}


def impurities(source: str) -> list[str]:
    """What a source does that a pure core may not, as `line: name`."""
    found = []
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Call(func=ast.Name(id=name)) if name in BUILTINS:
                found.append(f"{node.lineno}: {name}")
            case ast.Attribute(value=ast.Name(id="np" | "numpy"), attr=name) if name in OF_NUMPY:
                found.append(f"{node.lineno}: numpy.{name}")
            case ast.ImportFrom(module=str(module)) if module.startswith("numpy.random"):
                found.append(f"{node.lineno}: numpy.random")
            case ast.ImportFrom(module="numpy", names=names):
                found += [f"{node.lineno}: numpy.{alias.name}" for alias in names if alias.name in OF_NUMPY]
            case ast.Attribute(attr="tofile"):
                found.append(f"{node.lineno}: tofile")
    return found


@pytest.mark.parametrize("path", CORE, ids=lambda path: path.relative_to(PACKAGE).as_posix())
def test_the_core_is_pure(path):
    assert impurities(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    "source",
    [
        "open('a')",
        "print(1)",
        "rng = np.random.default_rng(0)",
        "from numpy.random import default_rng",
        "from numpy import random",
        "a = numpy.load('a')",
        "x.tofile('a')",
    ],
)
def test_an_impurity_is_seen(source):
    assert len(impurities(source)) == 1


def test_what_is_pure_is_let_through():
    assert impurities("import numpy as np\nx = np.zeros(3)\ny = model.load(x)\n") == []
