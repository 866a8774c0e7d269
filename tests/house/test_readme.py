"""What the README shows, works: its configurations are read, its Python names and its commands exist."""

from __future__ import annotations

import ast
import importlib
import re
from pathlib import Path

import pytest

from fusiond import config

PROJECT = Path(__file__).resolve().parents[2]
FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"^(?:\.venv/bin/)?fusiond ([a-z]+)", re.MULTILINE)
TARGET = re.compile(r"^make ([a-z]+)", re.MULTILINE)


@pytest.fixture(scope="module")
def shown() -> dict[str, list[str]]:
    """The README's fenced blocks by language."""
    blocks: dict[str, list[str]] = {}
    for language, text in FENCE.findall((PROJECT / "README.md").read_text(encoding="utf-8")):
        blocks.setdefault(language, []).append(text)
    return blocks


def missing_names(source: str) -> list[str]:
    """Names that a block imports from fusiond and that are not there."""
    imports = [
        node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ImportFrom) and node.module
    ]
    ours = [node for node in imports if node.module.split(".")[0] == "fusiond"]
    return [
        f"{node.module}.{alias.name}"
        for node in ours
        for alias in node.names
        if not hasattr(importlib.import_module(node.module), alias.name)
    ]


def test_a_whole_configuration_is_read(shown):
    whole = [text for text in shown.get("toml", []) if "[model]" in text]
    assert whole, "README.md: shows no configuration"
    for text in whole:
        assert config.parse(text, "README.md").sensor


def test_the_python_compiles_and_its_names_exist(shown):
    blocks = shown.get("python", [])
    assert blocks, "README.md: shows no Python"
    assert [name for text in blocks for name in missing_names(text)] == []


def test_the_commands_exist(shown):
    from typer.main import get_command

    from fusiond.cli import app

    said = {name for text in shown.get("bash", []) for name in COMMAND.findall(text)}
    assert said, "README.md: shows no command"
    assert said <= set(get_command(app).commands)


def test_the_make_targets_exist(shown):
    said = {name for text in shown.get("bash", []) for name in TARGET.findall(text)}
    targets = set(re.findall(r"^([a-z]+):", (PROJECT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    assert {"demo", "test"} <= said <= targets


def test_a_missing_name_is_seen():
    assert missing_names("from fusiond.types import Verdict, Nonsense") == ["fusiond.types.Nonsense"]
