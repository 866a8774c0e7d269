"""Compiling a step once, as a whole, where numba would do it again for every function on the way down.

Numba optimises each function together with all that it calls, and makes machine code and a wrapper for Python of it, in
case somebody calls that one. In a step of a hundred kernels, ten calls deep, the innermost is so optimised ten times:
half of a cold start. Here a kernel called by another is lowered to LLVM's language and left at that; only an
entry, the function that Python calls, links them all, optimises once and becomes machine code. The bits are the same.

This uses numba's custom pipelines (documented) and its code libraries (not: `pyproject.toml` pins numba to 0.68).
docs/decisions/0008 has the figures. Law: tests/laws/test_compiling.py.
"""

from __future__ import annotations

from typing import Any

from numba import _dynfunc  # type: ignore[attr-defined] # written in C
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering

OPTIONS = {"nopython": True, "error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True}
"""Division by zero gives inf or nan, as numpy does. No fast-math."""


class Part(JITCodeLibrary):
    """Code that is only ever linked into a `Whole`: optimised function by function, no machine code made of it.

    Without even that a cold start is half a second shorter, and every reading a tenth slower.
    """

    def finalize(self) -> None:
        """Nothing may be added any more."""
        self._finalized = True


class Whole(JITCodeLibrary):
    """Code that Python calls, with that of every kernel below it."""

    def add_linking_library(self, library: Any) -> None:
        """Have a library linked, and all that its parts call; callers first: the linker drops what nobody needs yet."""
        if library in self._linking_libraries:
            return
        super().add_linking_library(library)
        if isinstance(library, Part):
            for callee in library._linking_libraries:
                self.add_linking_library(callee)


def no_executable(library: Any, fndesc: Any, env: Any) -> Any:
    """Stands for a part's machine code in numba's tables; `Kernel.__call__` sees to it that nobody ever calls it."""
    return _dynfunc.make_function(fndesc.lookup_module(), fndesc.qualname, "", 0, env, (library,))


@register_pass(mutates_CFG=True, analysis_only=False)
class LowerPart(NativeLowering):
    """Numba's last pass, into a `Part`."""

    _name = "lower_part"

    def run_pass(self, state: Any) -> Any:
        """Lower the function of `state`."""
        state.library = Part(state.targetctx.codegen(), state.func_id.func_qualname)
        state.targetctx.get_executable = no_executable
        return super().run_pass(state)


@register_pass(mutates_CFG=True, analysis_only=False)
class LowerWhole(NativeLowering):
    """Numba's last pass, into a `Whole` that can be kept on disk."""

    _name = "lower_whole"

    def run_pass(self, state: Any) -> Any:
        """Lower the function of `state`, optimise it and make machine code of it."""
        state.library = Whole(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return super().run_pass(state)


def pipeline(state: Any, last: type) -> list[Any]:
    """Numba's own passes, the last of them exchanged."""
    passes = DefaultPassBuilder.define_nopython_pipeline(state)
    (place,) = (k for k, (one, _) in enumerate(passes.passes) if one is NativeLowering)
    passes.passes[place] = (last, passes.passes[place][1])
    passes._finalized = False
    passes.finalize()
    return [passes]


class PartCompiler(CompilerBase):
    """Compiles what compiled code calls."""

    def define_pipelines(self) -> list[Any]:
        """As numba asks."""
        return pipeline(self.state, LowerPart)


class WholeCompiler(CompilerBase):
    """Compiles what Python calls."""

    def define_pipelines(self) -> list[Any]:
        """As numba asks."""
        return pipeline(self.state, LowerWhole)


class Kernel(CPUDispatcher):
    """A function that compiled code calls as a part of itself; where Python calls it, a whole of it is compiled."""

    def __init__(self, function: Any) -> None:
        options = OPTIONS | {"no_cpython_wrapper": True}
        super().__init__(py_func=function, targetoptions=options, pipeline_class=PartCompiler)
        self._whole: Any = None

    def __call__(self, *args: Any) -> Any:
        """Call it from Python."""
        if self._whole is None:
            self._whole = whole(self.py_func)
        return self._whole(*args)


def whole(function: Any) -> Any:
    """The function compiled for Python, with all the kernels it calls."""
    return CPUDispatcher(py_func=function, targetoptions=OPTIONS, pipeline_class=WholeCompiler)
