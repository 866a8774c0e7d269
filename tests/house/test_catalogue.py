"""docs/catalogue.md: every fault has its line, and every test that a line names is there."""

from __future__ import annotations

import re
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[2]
PAGE = (PROJECT / "docs" / "catalogue.md").read_text(encoding="utf-8")
NAMED = sorted(set(re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", PAGE)))


def test_every_test_that_the_catalogue_names_exists():
    """A renamed test takes its line with it."""
    assert len(NAMED) > 30
    missing = [
        f"{path}::{name}"
        for path, name in NAMED
        if not (PROJECT / path).is_file()
        or (name and f"def {name}(" not in (PROJECT / path).read_text(encoding="utf-8"))
    ]
    assert not missing


def test_every_fault_of_the_catalogue_has_a_line():
    """F1 to F20, none without a word on what proves it."""
    rows = re.findall(r"^\| (F\d+) \|.*\| (.+) \|$", PAGE, re.MULTILINE)
    assert {name for name, _ in rows} == {f"F{k}" for k in range(1, 21)}
    assert all("tests/" in proof for _, proof in rows)
