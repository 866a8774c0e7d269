"""`fusiond check --plots DIR`: what of a configuration can be seen, drawn into a folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fusiond.assembly.adapting import rules_of
from fusiond.errors import ConfigError


def write_plots(assembly: Any, folder: Path) -> list[Path]:
    """Draw the fuzzy sets and the control surface; returns the files. Raises ConfigError."""
    section = assembly.config.adaptation
    if section is None or section.method != "fuzzy":
        raise ConfigError(
            '--plots: there is nothing to draw but fuzzy sets; say `method = "fuzzy"` in [adaptation], or leave it out'
        )
    try:
        from fusiond.cli.check_pictures import draw_sets, draw_surface
    except ImportError as error:
        raise ConfigError(
            f"--plots: matplotlib is missing ({error}); install it with `pip install fusiond[report]`"
        ) from error
    made = assembly.design[0]["noise"]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return [draw_sets(rules_of(section.fuzzy), folder), draw_surface(made, folder)]
    except OSError as error:
        raise ConfigError(
            f"--plots: {folder} cannot be written ({error.strerror}); name another folder"
        ) from error
