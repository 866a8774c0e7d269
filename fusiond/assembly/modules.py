"""Model files: the built-in ones by kind, a user's own by path, both described with the configuration's parameters."""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import sys
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from fusiond.config import nearest
from fusiond.errors import ConfigError


def user_module(file: str, folder: Path, subject: str) -> ModuleType:
    """Import a model file of the user's own, under a name made of its text; raises ConfigError.

    Args:
        file: path as configured, relative to `folder`.   subject: what the error is about, `model` say.
    """
    path = (folder / file).resolve()
    try:
        text = path.read_bytes()
    except OSError as error:
        raise ConfigError(
            f"{subject}.file: {file} cannot be read ({error.strerror}); paths are relative to the configuration"
        ) from error
    name = f"fusiond_user_{hashlib.sha256(text).hexdigest()[:16]}"
    if name in sys.modules:
        return sys.modules[name]
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ConfigError(f"{subject}.file: {file} is no Python file; give a model file that ends in .py")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise ConfigError(
            f"{subject}.file: {file} fails on import ({type(error).__name__}: {error}); correct the file"
        ) from error
    sys.modules[name] = module
    return module


def require(module: ModuleType, functions: tuple[str, ...], subject: str) -> None:
    """Raise ConfigError where a model file lacks a function of the contract."""
    for name in functions:
        if not hasattr(module, name):
            raise ConfigError(
                f"{subject}: the model file has no function `{name}`; fusiond.models.contract lists what it needs"
            )


def described(
    module: ModuleType, arguments: tuple[Any, ...], parameters: Mapping[str, Any], subject: str
) -> Any:
    """Call a model's `describe`; raises ConfigError with the subject for whatever is wrong with the parameters."""
    require(module, ("describe",), subject)
    wanted = {
        name: parameter
        for name, parameter in inspect.signature(module.describe).parameters.items()
        if parameter.kind is inspect.Parameter.KEYWORD_ONLY
    }
    for name in parameters:
        if name not in wanted:
            raise ConfigError(f"{subject}.{name}: unknown parameter; {nearest(name, wanted)}")
    for name, parameter in wanted.items():
        if name not in parameters and parameter.default is inspect.Parameter.empty:
            raise ConfigError(f"{subject}.{name}: is missing; add it")
    try:
        return module.describe(*arguments, **parameters)
    except ConfigError as error:
        joint = "." if str(error).partition(":")[0] in wanted else ": "
        raise ConfigError(f"{subject}{joint}{error}") from error
    except (TypeError, ValueError) as error:
        raise ConfigError(
            f"{subject}: the model file refuses its parameters ({error}); compare them with its describe"
        ) from error
