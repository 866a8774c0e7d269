"""A step compiled as a whole computes what its kernels compute one by one, from Python and from one another."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core import codegen, event

from fusiond.numerics.compiling import Kernel, Part
from fusiond.numerics.kernel import entry, interpreted, kernel


@kernel
def halved(x: float) -> float:
    """The innermost of three."""
    return 0.5 * x


@kernel
def summed(values: np.ndarray, scale: float) -> float:
    """Calls the innermost, and a function of numba's own."""
    total = 0.0
    for i in range(values.shape[0]):
        total += halved(values[i]) * max(scale, 1e-3)
    return total


@kernel
def spread(values: np.ndarray) -> float:
    """Calls both of the others."""
    return summed(values, halved(0.3)) / halved(float(values.shape[0]))


VALUES = np.random.default_rng(0).standard_normal(17)


def test_a_kernel_called_from_python_gives_the_bits_of_plain_python():
    """GIVEN kernels that call each other; WHEN Python calls each; THEN it gets what the plain functions give."""
    plain = 0.0
    for value in VALUES:
        plain += 0.5 * value * max(0.3, 1e-3)
    assert halved(0.3) == 0.15
    assert summed(VALUES, 0.3) == plain
    assert spread(VALUES) == interpreted(spread)(VALUES)


def test_a_kernel_gives_the_bits_that_numba_gives_it_alone():
    """GIVEN the same function; WHEN numba compiles it in its own way; THEN the bits are equal."""

    def dot(a: np.ndarray, b: np.ndarray) -> float:
        total = 0.0
        for i in range(a.shape[0]):
            total += a[i] * b[i] + a[i] / 3.0
        return total

    ours, theirs = kernel(dot), numba.njit(error_model="numpy")(dot)
    assert ours(VALUES, VALUES[::-1].copy()) == theirs(VALUES, VALUES[::-1].copy())


def test_inner_kernels_become_no_machine_code(monkeypatch: pytest.MonkeyPatch):
    """GIVEN an entry three calls deep; WHEN it is compiled; THEN of its kernels it alone is made machine code."""
    finished: list[str] = []
    finish = codegen.JITCodeLibrary._finalize_final_module

    def count(library: codegen.JITCodeLibrary) -> None:
        finished.append(library.name)
        finish(library)

    @kernel
    def inner(x: float) -> float:
        return x + 1.0

    @kernel
    def middle(x: float) -> float:
        return inner(x) * 2.0

    def outer(x: float) -> float:
        return middle(x) - 3.0

    monkeypatch.setattr(codegen.JITCodeLibrary, "_finalize_final_module", count)
    with event.install_recorder("numba:compile") as recorder:
        assert Kernel(outer)(4.0) == 7.0
    compiled = {one.data["dispatcher"].py_func.__name__ for _, one in recorder.buffer}
    assert compiled == {"inner", "middle", "outer"}
    assert [name.rsplit(".")[-1] for name in finished] == ["outer"]
    assert isinstance(inner.overloads[(numba.float64,)].library, Part)  # type: ignore[attr-defined]


def test_machine_code_of_an_entry_is_kept_on_disk_with_all_its_kernels(tmp_path: Path):
    """GIVEN an entry compiled by one process; WHEN another calls it; THEN it is loaded, not compiled, and the same."""
    (tmp_path / "whole.py").write_text(
        "from fusiond.numerics.kernel import entry, kernel\n"
        "@kernel\ndef inner(x):\n    return x / 3.0\n"
        "@entry\ndef outer(x):\n    return inner(x) - 1.0\n"
        "print(outer(5.0).hex(), sum(outer.stats.cache_hits.values()))\n"
    )
    said = [
        subprocess.run(
            [sys.executable, "whole.py"], cwd=tmp_path, capture_output=True, text=True, check=True
        ).stdout.split()
        for _ in range(2)
    ]
    assert said == [[(5.0 / 3.0 - 1.0).hex(), "0"], [(5.0 / 3.0 - 1.0).hex(), "1"]]


def test_an_entry_is_called_directly_by_its_types():
    """GIVEN an entry; WHEN it is called with two types; THEN each has its own machine code, as with numba."""

    @entry
    def doubled(x: float) -> float:
        return halved(x) * 4.0

    assert doubled(2.0) == 4.0
    assert doubled(np.float32(2.0)) == 4.0
    assert len(doubled.overloads) == 2  # type: ignore[attr-defined]
