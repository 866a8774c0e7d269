"""`fusiond check` shows the diagnosability matrix so that a terminal of 80 columns holds it."""

from __future__ import annotations

import io
from typing import Any

import pytest
from rich.console import Console

from fusiond.cli.diagnosability_view import show_diagnosability


def row(**given: Any) -> dict[str, Any]:
    """A row of `check --json`, with what is given in it."""
    plain = {"sensor": "gps", "channel": "x_m", "kind": "bias", "smallest": 0.5, "delay_s": 2.0}
    return {**plain, "ambiguous_with": [], "reason": "", "cured_by": [], **given}


def shown(*rows: dict[str, Any], promise_s: float | None = None) -> str:
    """What a terminal of 80 columns gets to see."""
    terminal = Console(file=io.StringIO(), width=80)
    thresholds = {} if promise_s is None else {"mean_time_between_false_alarms_s": promise_s}
    show_diagnosability({"diagnosability": list(rows), "thresholds": thresholds}, terminal)
    text: str = terminal.file.getvalue()
    return text


@pytest.mark.parametrize(
    ("kind", "size", "said"),
    [
        ("bias", 0.5, "0.5 "),
        ("drift", 0.25, "0.25 /s"),
        ("noise", 1.5, "1.5 x"),
        ("scale", 0.07, "7 %"),
        ("delay", 0.1, "0.1 s"),
    ],
)
def test_a_size_has_the_unit_of_its_kind(kind, size, said):
    assert said in shown(row(kind=kind, smallest=size))


def test_what_several_rows_remark_is_said_once_below_the_table():
    reason = "sizes hold for the trial motion"
    text = shown(row(reason=reason), row(kind="scale", reason=reason), row(kind="drift"))
    assert text.count(reason) == 1
    assert text.count("(1)") == 3


def test_what_is_never_found_says_so():
    text = shown(row(smallest=None, delay_s=None, reason="nothing shows it"))
    assert "never" in text
    assert "nothing shows it" in text


def test_the_title_says_whose_promise_it_is():
    assert "one false alarm in 3600 s" in shown(row(), promise_s=3600.0)
    assert "[faults]" in shown(row())
