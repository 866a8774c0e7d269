"""Copies element by element. `to[:] = source` would do, but numba then compiles its error texts: seconds of a start."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fusiond.numerics.kernel import kernel


@kernel
def copy_vector(source: NDArray[np.float64], to: NDArray[np.float64]) -> None:
    """Write source (n,) to the first n elements of `to`."""
    for i in range(source.shape[0]):
        to[i] = source[i]


@kernel
def copy_matrix(source: NDArray[np.float64], to: NDArray[np.float64]) -> None:
    """Write source (n, m) to the first n rows and m columns of `to`."""
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            to[i, j] = source[i, j]
