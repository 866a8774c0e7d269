"""What was learnt of the sensors' noise, kept across restarts: `noise.json` in the state directory that systemd names.

Without $STATE_DIRECTORY nothing is kept: a daemon started by hand leaves no files behind.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from fusiond.engine.noise_learnt import Learnt

NAME = "noise.json"


def noise_file() -> Path | None:
    """Where it is kept; None where nobody says."""
    first = os.environ.get("STATE_DIRECTORY", "").split(":")[0]
    return Path(first) / NAME if first else None


def read_noise(path: Path | None) -> tuple[dict[str, Any], str]:
    """What was learnt, and what was wrong with the file; both are empty where there is none."""
    if path is None or not path.is_file():
        return {}, ""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        return {}, f"{path}: what was learnt of the noise cannot be read ({error}); it is learnt anew"
    sound = isinstance(found, dict) and all(isinstance(one, dict) for one in found.values())
    return (found, "") if sound else ({}, f"{path}: holds no noise by sensor; it is learnt anew")


def write_noise(path: Path | None, learnt: Learnt) -> str:
    """Keep what was learnt, in one move; returns what was wrong, empty if nothing."""
    if path is None or not learnt:
        return ""
    draft = path.with_suffix(".draft")
    try:
        draft.write_text(json.dumps(learnt), encoding="utf-8")
        draft.replace(path)
    except OSError as error:
        return f"{path}: what was learnt of the noise cannot be kept ({error.strerror}); make the folder writable"
    return ""
