"""Parts of the scoreboard kept as JSON, so that a page can be written of parts measured one after the other."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from tools.scoreboard.board import Result, Row


def dumped(told: Mapping[str, Any]) -> str:
    """JSON of numbers that may still be numpy's."""
    return json.dumps(told, default=lambda number: number.item())


def keep(folder: Path, part: str, result: Result) -> None:
    """Write a part's rows and curves into the folder, in the place of older ones."""
    folder.mkdir(parents=True, exist_ok=True)
    curves = {
        name: {k: np.asarray(v).tolist() for k, v in curve.items()} for name, curve in result.curves.items()
    }
    told = {"rows": [asdict(row) for row in result.rows], "curves": curves}
    (folder / f"{part}.json").write_text(dumped(told), encoding="utf-8")


def kept(folder: Path, part: str) -> Result:
    """A part as it was kept; empty where it was not."""
    path = folder / f"{part}.json"
    if not path.is_file():
        return Result()
    told = json.loads(path.read_text(encoding="utf-8"))
    return Result([Row(**row) for row in told["rows"]], told["curves"])
