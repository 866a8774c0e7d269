"""How kernels are compiled: one decorator for every function that runs per reading.

Kernels are not cached on disk one by one: numba does not notice when a kernel called from another file changes. Only
the assembled step is cached, in a folder named by the hash of everything it was compiled from (`fusiond.assembly`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar

import numba

P = ParamSpec("P")
T = TypeVar("T")


def kernel(function: Callable[P, T]) -> Callable[P, T]:
    """Compile a pure function of arrays and numbers; division by zero gives inf or nan, as numpy does.

    No fast-math: a sum is taken in the order written, so that two configurations that compute the same thing
    give the same bits.
    """
    compiled: Callable[P, T] = numba.njit(error_model="numpy", nogil=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)(function)
    return compiled


def entry(function: Callable[P, T]) -> Callable[P, T]:
    """Compile the one function that Python calls, and keep the machine code on disk beside its source."""
    compiled: Callable[P, T] = numba.njit(error_model="numpy", nogil=True, cache=True)(function)
    return compiled


def interpreted(function: Callable[P, T]) -> Callable[P, T]:
    """The plain Python behind a kernel, for design time, where compiling would take longer than running."""
    plain: Callable[P, T] = getattr(function, "py_func", function)
    return plain
