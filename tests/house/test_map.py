"""ARCHITECTURE.md is the map: every module is on it once, with a line that says what it is for."""

from __future__ import annotations

import re
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[2]
MAP = (PROJECT / "ARCHITECTURE.md").read_text(encoding="utf-8")
LINE = re.compile(r"^- `(?P<path>(?:fusiond|tools)/[\w/]+\.py)`: (?P<purpose>\S.*)$", re.MULTILINE)
ROOM = re.compile(r"^### `(?P<path>(?:fusiond|tools)/(?:[\w/]+/)?)`", re.MULTILINE)


def modules() -> set[str]:
    """Every module as a path from the root; `__init__.py` stands for its room, which has a heading."""
    found = {*(PROJECT / "fusiond").rglob("*.py"), *(PROJECT / "tools").rglob("*.py")}
    return {path.relative_to(PROJECT).as_posix() for path in found if path.name != "__init__.py"}


def rooms() -> set[str]:
    modules = [*(PROJECT / "fusiond").rglob("*.py"), *(PROJECT / "tools").rglob("*.py")]
    return {f"{path.parent.relative_to(PROJECT).as_posix()}/" for path in modules}


def on_the_map() -> list[str]:
    return [match["path"] for match in LINE.finditer(MAP)]


def test_every_module_is_on_the_map():
    assert sorted(modules() - set(on_the_map())) == []


def test_every_module_on_the_map_exists():
    assert sorted(set(on_the_map()) - modules()) == []


def test_no_module_is_on_the_map_twice():
    paths = on_the_map()
    assert sorted({path for path in paths if paths.count(path) > 1}) == []


def test_every_room_has_a_heading_and_every_heading_a_room():
    assert {match["path"] for match in ROOM.finditer(MAP)} == rooms()


def test_every_room_is_a_package():
    """A folder without `__init__.py` would escape the import contracts."""
    assert [room for room in rooms() - {"tools/"} if not (PROJECT / room / "__init__.py").is_file()] == []
