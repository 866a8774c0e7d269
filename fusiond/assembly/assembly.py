"""Configuration to engine."""

from __future__ import annotations

import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.adapting import method_of
from fusiond.assembly.design import design_of, layout_of
from fusiond.assembly.detection import Detection
from fusiond.assembly.expected_cost import Expected, expected_costs
from fusiond.assembly.jacobians import check_jacobians
from fusiond.assembly.modules import require
from fusiond.assembly.observability import require_observable
from fusiond.assembly.package import (
    import_package,
    inject_file,
    is_compiled,
    source_of,
    step_sources,
    write_package,
)
from fusiond.assembly.plain import check_choices, plain_design, plain_sources
from fusiond.assembly.protecting import protected, write_protection
from fusiond.assembly.resolve import Resolved, by_key, resolve
from fusiond.assembly.watching import judge_of, obey, overseen, watched, write_tests
from fusiond.config import Config, read
from fusiond.control.plant import Plan
from fusiond.engine.engine import Derive, Engine
from fusiond.engine.layout import Layout
from fusiond.engine.overseer import Overseer
from fusiond.engine.plain.running import running
from fusiond.errors import ConfigError, FusiondError
from fusiond.numerics.kernel import interpreted
from fusiond.types import TICK


@dataclass(frozen=True)
class Assembly:
    """A configuration that holds together, ready to make engines.

    Args:
        layout: what its records mean.   design: (1,) design record.   detection: its tests, None without them.
        overseer: of a plain step with fault detection, the compiled configuration that judges for it.
    """

    resolved: Resolved
    layout: Layout
    design: NDArray[np.void]
    detection: Detection | None = None
    overseer: Assembly | None = None

    @property
    def config(self) -> Config:
        """The configuration it was made from."""
        return self.resolved.config

    @property
    def plan(self) -> Plan | None:
        """What the control law was designed from; None where it was not."""
        return self.resolved.law.plan if self.resolved.law else None

    @cached_property
    def expected_costs(self) -> list[Expected]:
        """What control should cost with every set of working sensors."""
        return expected_costs(self.resolved)

    @cached_property
    def package(self) -> ModuleType:
        """The step's module `run`: compiled on first use or loaded from the cache, or plain."""
        resolved = self.resolved
        names = _file_names(resolved)
        sensors = [
            (name, source_of(sensor.module) if sensor.module else "")
            for name, sensor in zip(names, resolved.sensors, strict=True)
        ]
        law = source_of(resolved.law_module) if resolved.law_module else None
        process = source_of(resolved.process_module)
        errors = inject_file(resolved.process)
        files = step_sources(
            self.layout.shape, process, resolved.process.linear, errors, law, sensors, method_of(resolved)
        )
        if self.layout.plain:
            files = plain_sources(self.config, files, linear=resolved.process.linear)
        return import_package(write_package(files))

    def engine(self) -> Engine:
        """A fresh engine, before its first reading."""
        run = running(self.package.run) if self.layout.plain else self.package.run
        judge = None if self.overseer else judge_of(self.resolved, self.layout, self.detection, self.design)
        overseer = Overseer(self.overseer.engine()) if self.overseer else None
        return Engine(self.layout, self.design, self._desk(), run, self._derive(), judge, overseer)

    @property
    def is_compiled(self) -> bool:
        """Whether the step is in the cache, or needs no compiling: `prepare` then takes no long time."""
        return self.layout.plain or is_compiled(self.package)

    def prepare(self) -> None:
        """Compile the step, or load it from the cache, before anybody waits for a reading."""
        tick = np.zeros(1, self.layout.reading)
        tick["sensor"] = TICK
        self.engine().process(tick)

    def _desk(self) -> NDArray[np.void]:
        """The first desk record: the configured reference."""
        desk = np.zeros(1, self.layout.desk)
        section, law = self.config.control, self.resolved.law
        if law is not None and not law.references:
            desk[0]["has_reference"] = 1
        if section is not None and section.reference:
            values = by_key(section.reference, self.layout.references, "control.reference")
            desk[0]["reference"][:] = [values.get(slot.name, 0.0) for slot in self.layout.references]
            desk[0]["has_reference"] = 1
        return desk

    def _derive(self) -> Derive | None:
        """The process model's `derive`, interpreted."""
        if not self.resolved.process.outputs:
            return None
        require(self.resolved.process_module, ("derive",), "model")
        derive: Derive = interpreted(self.resolved.process_module.derive)
        return derive


def _file_names(resolved: Resolved) -> list[str]:
    """A file name for each sensor's model in the package, one for each distinct model file."""
    modules = sorted({sensor.module.__name__ for sensor in resolved.sensors if sensor.module})
    return [
        f"sensor_{modules.index(sensor.module.__name__)}" if sensor.module else ""
        for sensor in resolved.sensors
    ]


@contextmanager
def blaming_users_files(config: Config) -> Iterator[None]:
    """Turn what a model file of the operator's own raises when it is first called into a ConfigError."""
    files = [section.file for section in (config.model, *config.sensor.values()) if hasattr(section, "file")]
    try:
        yield
    except FusiondError:
        raise
    except Exception as error:
        if not files:
            raise
        line = traceback.extract_tb(error.__traceback__)[-1].lineno
        raise ConfigError(
            f"{', '.join(files)}: fails when called ({type(error).__name__}: {error}, line {line}); correct the file"
        ) from error


def assemble(config: Config, folder: Path = Path()) -> Assembly:
    """Derive everything a configuration implies; raises ConfigError.

    Args:
        folder: where the configuration lies; model files named in it are relative to it.
    """
    check_choices(config)
    resolved = resolve(config, folder)
    with blaming_users_files(config):
        layout = layout_of(resolved)
        if layout.plain and resolved.process.errors:
            raise ConfigError(
                'filter.recursion: the state of this model is no vector; leave it at "ud", centralized'
            )
        check_jacobians(resolved)
        require_observable(resolved)
    layout, detection = watched(resolved, layout)
    layout = protected(resolved, layout)
    design = design_of(resolved, layout)
    write_tests(resolved, detection, design)
    write_protection(resolved, layout, design)
    if not layout.plain:
        return Assembly(resolved, layout, design, detection)
    overseer = assemble(overseen(config), folder) if config.faults else None
    if overseer is not None:
        obey(design, overseer.design)
        detection = overseer.detection
    design = plain_design(resolved, layout, design)
    return Assembly(resolved, layout, design, detection, overseer)


def load(path: Path) -> Assembly:
    """Read a configuration file and assemble it; raises ConfigError."""
    return assemble(read(path), path.parent)
