"""Nothing in the project names the machine it was written on, or an address packages came from."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parents[2]
# Put together here, so that this file does not hold what it looks for.
TRACES = [
    f"{PROJECT}/",
    f"{PROJECT.parent / 'shared'}/",
    f"{Path.home()}/",
    "index" + "-url",
    "find" + "-links",
]


def texts() -> list[Path]:
    """Every file of the work tree that git would keep and that is text."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z"],
        cwd=PROJECT,
        capture_output=True,
        check=True,
        text=True,
    ).stdout
    found = [PROJECT / name for name in listed.split("\0") if name]
    return [path for path in found if path.is_file() and b"\0" not in path.read_bytes()[:1024]]


@pytest.mark.parametrize("trace", TRACES)
def test_no_file_holds_a_trace(trace):
    holders = [path.name for path in texts() if trace in path.read_text(encoding="utf-8", errors="replace")]
    assert holders == []


def test_the_files_looked_at_are_the_projects():
    assert {"pyproject.toml", "Makefile", "test_no_traces.py"} <= {path.name for path in texts()}
