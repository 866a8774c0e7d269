"""Reading the configuration a command was given: another file of fusiond's is called by its name."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fusiond.assembly.assembly import Assembly
from fusiond.errors import ConfigError
from fusiond.service import roles
from fusiond.service.settings import settings_of


def load(path: Path, part: str | None = None) -> Assembly:
    """Assemble a configuration file, or one machine's part of it; raises ConfigError that names the file."""
    try:
        with naming(path):
            assembly = roles.load(path, part)
            settings_of(assembly.config, assembly.layout, (), ())
            return assembly
    except ConfigError as error:
        if is_mapping(path):
            raise ConfigError(
                f"{path}: is a mapping file of `fusiond import`, no configuration; give the configuration that its log "
                "is meant for"
            ) from error
        raise


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Within it every line of a ConfigError names the file, unless it does or is about the command line."""
    try:
        yield
    except ConfigError as error:
        known = (str(path), path.name, "--")
        lines = str(error).splitlines()
        said = (line if line.startswith(known) else f"{path}: {line}" for line in lines)
        raise ConfigError("\n".join(said)) from error


def is_mapping(path: Path) -> bool:
    """Whether a file says where a recording's numbers stand: it has sensors with `values`, and no model."""
    try:
        said = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    sensors = said.get("sensor")
    if "model" in said or not isinstance(sensors, dict):
        return False
    return any(isinstance(sensor, dict) and "values" in sensor for sensor in sensors.values())
