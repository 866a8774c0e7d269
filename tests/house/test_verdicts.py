"""Every way in which a reading can be refused is shown by some test."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from fusiond.types import Verdict

TESTS = Path(__file__).resolve().parents[1]


def named_in_tests(source: str) -> set[str]:
    """Verdicts a test names, as the member or as the quoted word an operator reads."""
    members = set(re.findall(r"\bVerdict\.([A-Z_]+)\b", source))
    words = {word.upper() for word in re.findall(r"""["']([a-z_]+)["']""", source)}
    return members | (words & set(Verdict.__members__))


@pytest.fixture(scope="module")
def shown() -> set[str]:
    sources = [p.read_text(encoding="utf-8") for p in TESTS.rglob("test_*.py") if p.parent.name != "house"]
    return set().union(*(named_in_tests(source) for source in sources))


@pytest.mark.parametrize("verdict", [verdict.name for verdict in Verdict])
def test_a_verdict_is_shown_by_some_test(verdict, shown):
    assert verdict in shown, (
        f"Verdict.{verdict}: no test outside the house names it; write the one that produces it"
    )


def test_both_spellings_are_read():
    assert named_in_tests('Verdict.TOO_LATE; {"bad_crc": 1}; "some_word"') == {"TOO_LATE", "BAD_CRC"}
