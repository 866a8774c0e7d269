"""Logs of the recordings, imported once a session with the project's own mapping files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tools.pages.recorded import FOLDERS, import_from


@pytest.fixture(scope="session")
def imported_logs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Logs imported so far, by recording."""
    return {"folder": tmp_path_factory.mktemp("logs")}


@pytest.fixture
def log_of(recording: Callable[[str], Path], imported_logs: dict[str, Path]) -> Callable[[str], Path]:
    """The log of a recording that stands in the test's own mark, its truth beside it."""

    def log(name: str) -> Path:
        folder = recording(FOLDERS.get(name, name))
        if name not in imported_logs:
            imported_logs[name] = import_from(folder, name, imported_logs["folder"])
        return imported_logs[name]

    return log
