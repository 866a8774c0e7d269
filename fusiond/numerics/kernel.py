"""How kernels are compiled: one decorator for every function that runs per reading.

Kernels are not cached on disk one by one: numba does not notice when a kernel called from another file changes. The
assembled step is, in a folder named by the hash of everything it was compiled from (`fusiond.assembly`).
With NUMBA_DISABLE_JIT=1 nothing is compiled.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import numba

from fusiond.numerics.compiling import Kernel, whole

P = ParamSpec("P")
T = TypeVar("T")
DISABLED = bool(numba.config.DISABLE_JIT)  # type: ignore[attr-defined] # numba reads it from the environment


def kernel(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a pure function of arrays and numbers; division by zero gives inf or nan, as numpy does.

    No fast-math: a sum is taken in the order written, so that two configurations that compute the same thing
    give the same bits.
    """
    compiled: Any = function if DISABLED else Kernel(function)
    typed: Callable[P, T] = compiled
    return typed


def entry(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a function that Python calls, and keep the machine code on disk beside its source.

    Only where an edit cannot leave stale code behind: its callees stand in the same file, or the file's folder is
    named by the hash of all of them.
    """
    if DISABLED:
        return function
    compiled: Any = whole(function)
    compiled.enable_caching()
    typed: Callable[P, T] = compiled
    return typed


def interpreted(function: Callable[P, T]) -> Callable[P, T]:
    """The plain Python behind a kernel, for design time, where compiling would take longer than running."""
    plain: Callable[P, T] = getattr(function, "py_func", function)
    return plain
