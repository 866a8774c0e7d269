"""docs/seed_004.md says what the engine does."""

from __future__ import annotations

import re
from pathlib import Path

from tools.pages import seed_004_page, seeds

TEXT = seed_004_page.PAGE.read_text(encoding="utf-8")
TESTS = Path(__file__).resolve().parents[1]


def test_the_page_is_what_is_measured_now():
    """The cheap rows, measured again, are those of the page."""
    assert seeds.differences(TEXT, seed_004_page.cheap_rows()) == []


def test_every_figure_of_the_page_is_as_expected():
    assert "**no**" not in TEXT


def test_every_picture_of_the_page_is_there():
    named = re.findall(r"\]\((pictures/[^)]+)\)", TEXT)
    assert named
    assert [name for name in named if not (seeds.DOCS / name).is_file()] == []


def test_every_proof_that_the_page_names_exists():
    """A test named beside a misprint is a function in a test file of that name."""
    where = ""
    missing = []
    for file, function in re.findall(r"(\w+\.py)?::(test_\w+)", TEXT):
        where = file or where
        found = list(TESTS.rglob(where))
        if not (found and f"def {function}(" in found[0].read_text(encoding="utf-8")):
            missing.append(f"{where}::{function}")
    assert missing == []
