"""The compiled step of one configuration: a small package of source files in the cache, named by its own hash.

The template `fusiond.engine.step` is copied beside the configuration's process model, sensor models and control law.
The folder's name is the hash of every source the machine code depends on and of the compiler's version, so an edited
model gets another folder and can never meet a stale kernel, and numba's own disk cache does the rest.
"""

from __future__ import annotations

import hashlib
import importlib
import importlib.util
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import ModuleType

import numba
import numpy as np

import fusiond
from fusiond.engine import records, step
from fusiond.engine.step import sizes
from fusiond.models.contract import Process

SWAPPED = (
    "process.py", "observe.py", "law.py", "sizes.py", "advance.py", "advance_nonlinear.py", "inject.py",
    "inject_manifold.py", "inject_turning.py", "monitor_on.py", "protect.py", "protect_on.py", "guard.py",
    "guard_on.py", "pending.py", "pending_on.py", "steer.py", "steer_on.py", "feed.py", "feed_on.py",
    "adapt.py", "adapt_on.py", "levels.py", "levels_on.py", "method.py",
)  # fmt: skip
"""Files of the template that a configuration replaces."""
STEADY = 20
"""Healthy silences for which a sensor must speak, without another, before it is silent no longer."""
WATCHING = ("decided.py", "signatures.py", "spread_tests.py")
"""Files of the template that only a configuration with fault detection needs."""
ROOMS = ("numerics", "models", "filters", "fusion", "faults", "adapt", "control")
"""Where the kernels live that a step calls."""


def cache_folder() -> Path:
    """Where compiled steps are kept: $FUSIOND_CACHE, else the user's cache folder."""
    if chosen := os.environ.get("FUSIOND_CACHE"):
        return Path(chosen)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fusiond"


def source_of(module: ModuleType) -> str:
    """Source text of an imported module."""
    assert module.__file__ is not None
    return Path(module.__file__).read_text(encoding="utf-8")


def folder_sources(module: ModuleType) -> dict[str, str]:
    """Source text of every module in a package's folder, by file name."""
    return {
        path.name: path.read_text(encoding="utf-8") for path in sorted(Path(module.__path__[0]).glob("*.py"))
    }


def observe_source(sensors: Sequence[str]) -> str:
    """The dispatch from a sensor's number to the model in the file named for it ('' for one without a model)."""
    files = sorted({name for name in sensors if name})
    lines = ['"""Which sensor model reads which sensor; written by assembly."""', ""]
    lines += ["from fusiond.numerics.kernel import kernel", ""]
    lines += [f"from .{name} import observe as {name}" for name in files]
    lines += ["", "", "@kernel", "def observe(sensor, x, z, at, p, h, H):"]
    for number, name in enumerate(sensors):
        if name:
            lines += [f"    if sensor == {number}:", f"        return {name}(x, z, at, p, h, H)"]
    return "\n".join([*lines, "    return False", ""])


def sizes_source(shape: records.Shape) -> str:
    """The sizes of the records as constants."""
    constants = {
        "STATES": shape.states, "ERRORS": shape.errors, "INPUTS": shape.inputs, "NOISES": shape.noises,
        "FEEDS": shape.feeds,
        "SENSORS": shape.sensors, "FILTERS": shape.filters, "PAYLOAD": shape.payload, "CONTROLS": shape.controls,
        "STEADY": STEADY if shape.cells else 0, "CELLS": shape.cells, "WINDOW": shape.window,
        "PROTECTED": shape.protected, "GUARDED": shape.guarded, "ADAPTS": int(shape.adapt is not None),
        "BINS": shape.adapt.bins if shape.adapt else 0,
        "SNAPSHOT_EVERY": sizes.SNAPSHOT_EVERY,
    }  # fmt: skip
    return "".join([f"{name} = {value}\n" for name, value in constants.items()])


def inject_file(process: Process) -> str:
    """The file of the template that adds errors to the state of this model."""
    if process.turning is not None and process.turning.follows:
        return "inject_turning.py"
    return "inject_manifold.py" if process.errors else "inject.py"


def noise_sources(shape: records.Shape, template: Mapping[str, str], method: str | None) -> dict[str, str]:
    """The step's files for the estimation of noise; `method` is a module of `fusiond.adapt`, None: R is as declared."""
    if method is None or shape.adapt is None:
        return {"adapt.py": template["adapt.py"]}
    chosen = "How noise is estimated; written by assembly."
    return {
        "adapt.py": template["adapt_on.py"],
        "levels.py": template["levels_on.py" if shape.adapt.bins else "levels.py"],
        "method.py": f'"""{chosen}"""\n\nfrom fusiond.adapt.{method} import begin, weigh\n',
    }


def step_sources(
    shape: records.Shape, process: str, linear: bool, errors: str, law: str | None,
    sensors: Sequence[tuple[str, str]], method: str | None = None,
) -> dict[str, str]:  # fmt: skip
    """Every file of one configuration's step, by name.

    Args:
        process, law: source text of the process model and of the control law (None: no control).
        linear: the model is linear and time-invariant.
        errors: file of the template that adds errors to its state (`inject_file`).
        sensors: for each sensor, a name for its model and the model's source text; ('', '') for an input.
        method: of estimating noise, a module of `fusiond.adapt`; None where R is as declared.
    """
    template = folder_sources(step)
    files = {name: text for name, text in template.items() if name not in SWAPPED}
    files["advance.py"] = template["advance.py" if linear else "advance_nonlinear.py"]
    files["inject.py"] = template[errors]
    files["protect.py"] = template["protect_on.py" if shape.protected > 0 else "protect.py"]
    files["pending.py"] = template["pending_on.py" if shape.lazy else "pending.py"]
    files["guard.py"] = template["guard_on.py" if shape.guarded > 0 else "guard.py"]
    files["steer.py"] = template["steer.py" if law is None else "steer_on.py"]
    files["feed.py"] = template["feed_on.py" if shape.feeds else "feed.py"]
    files |= noise_sources(shape, template, method)
    if shape.cells > 0:
        files["monitor.py"] = template["monitor_on.py"]
    else:
        files = {name: text for name, text in files.items() if name not in WATCHING}
    files["sizes.py"] = sizes_source(shape)
    files["process.py"] = process
    files["law.py"] = template["law.py"] if law is None else law
    files["observe.py"] = observe_source([name for name, _ in sensors])
    files |= {f"{name}.py": text for name, text in sensors if name}
    return files


def shared_sources() -> dict[str, str]:
    """Source text of everything a step may be compiled with beside its own files, by path below the project."""
    root = Path(fusiond.__path__[0])
    paths = [path for room in ROOMS for path in (root / room).rglob("*.py")]
    shared = sorted([*paths, root / "types.py", root / "engine" / "records.py"])
    return {path.relative_to(root).as_posix(): path.read_text(encoding="utf-8") for path in shared}


def fingerprint(files: Mapping[str, str]) -> str:
    """Hash of a step's own files and of all they are compiled with."""
    versions = (platform.python_version(), numba.__version__, np.__version__, platform.machine())
    digest = hashlib.sha256(repr(versions).encode())
    for name, text in [*sorted(files.items()), *sorted(shared_sources().items())]:
        digest.update(f"{name}\0{len(text)}\0{text}".encode())
    return digest.hexdigest()[:24]


def write_package(files: Mapping[str, str]) -> Path:
    """Write the files into the cache, if they are not there, in one move that another process may win."""
    folder = cache_folder() / "steps" / fingerprint(files)
    if folder.is_dir():
        return folder
    folder.parent.mkdir(parents=True, exist_ok=True)
    draft = Path(tempfile.mkdtemp(dir=folder.parent, prefix="draft-"))
    for name, text in files.items():
        (draft / name).write_text(text, encoding="utf-8")
    try:
        draft.rename(folder)
    except OSError:
        shutil.rmtree(draft)
        if not folder.is_dir():
            raise
    return folder


def import_package(folder: Path) -> ModuleType:
    """Import the package in the folder, once a process, as `fusiond_step_HASH`; returns its module `run`."""
    name = f"fusiond_step_{folder.name}"
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(
            name, folder / "__init__.py", submodule_search_locations=[str(folder)]
        )
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        spec.loader.exec_module(module)
    return importlib.import_module(f"{name}.run")


def is_compiled(package: ModuleType) -> bool:
    """Whether the machine code of a step's package is in the cache."""
    return any((Path(str(package.__file__)).parent / "__pycache__").glob("run.run-*.nbc"))
