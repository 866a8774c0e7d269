"""The retracing step of a configuration: its compiled step, with what a smoother needs kept."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from fusiond.assembly.assembly import Assembly
from fusiond.assembly.package import folder_sources, import_package, write_package
from fusiond.assembly.trial import Trial
from fusiond.engine import retrace
from fusiond.engine.retrace.tracer import Tracer
from fusiond.errors import ConfigError

Floats = NDArray[np.float64]
WRAPPED = ("advance.py", "update.py")
"""Files of the compiled step that keep their work under the name `step_NAME`."""


def retrace_sources(files: Mapping[str, str], *, linear: bool) -> dict[str, str]:
    """Every file of a retracing step.

    Args:
        files: those of the compiled step.
    """
    own = folder_sources(retrace)
    chosen = {
        "run.py": own["run.py"],
        "chain.py": own["chain.py"],
        "update.py": own["update.py"],
        "advance.py": own["advance_linear.py" if linear else "advance_nonlinear.py"],
    }
    chosen = {name: _neighbourly(text) for name, text in chosen.items()}
    return {**files, **{f"step_{name}": files[name] for name in WRAPPED}, **chosen}


def _neighbourly(text: str) -> str:
    """A source whose imports from `fusiond.engine.step` go to the files beside it."""

    def neighbour(match: re.Match[str]) -> str:
        name = match["name"]
        return f"from .step_{name} import" if f"{name}.py" in WRAPPED else f"from .{name} import"

    return re.sub(r"from fusiond\.engine\.step\.(?P<name>\w+) import", neighbour, text)


def tracer_of(assembly: Assembly) -> Tracer:
    """A tracer before its first reading. Raises ConfigError where the step keeps no factors."""
    if assembly.layout.plain:
        raise ConfigError(
            "--smooth: this configuration's recursion or topology is not the compiled centralized filter, the only one "
            "that can be smoothed; leave [filter] recursion and [fusion] topology out"
        )
    if assembly.config.adaptation is not None:
        raise ConfigError(
            "--smooth: an estimate of noise is no linear update, and the smoother needs those; leave [adaptation] out"
        )
    return Tracer(assembly.layout, assembly.design, retrace_package(assembly).run)


def retrace_package(assembly: Assembly) -> ModuleType:
    """The module `run` of the retracing step, written beside the compiled step it is made of."""
    assert assembly.package.__file__ is not None
    folder = Path(assembly.package.__file__).parent
    files = {path.name: path.read_text(encoding="utf-8") for path in sorted(folder.glob("*.py"))}
    return import_package(write_package(retrace_sources(files, linear=assembly.resolved.process.linear)))


def injection_of(assembly: Assembly) -> Callable[[Floats, Floats], Floats]:
    """x [+] dx of one state (states,) by its error (errors,), angles in [-pi, pi), interpreted."""
    trial = Trial(assembly.resolved)
    circular = assembly.design["angle"][0] != 0

    def inject(x: Floats, dx: Floats) -> Floats:
        moved = trial.shift(x, dx)
        return np.where(circular, (moved + np.pi) % (2.0 * np.pi) - np.pi, moved)

    return inject
