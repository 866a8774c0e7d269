"""The entry of a plain step with the signature of the compiled one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np


def running(run: Callable[..., int]) -> Callable[..., int]:
    """Wrap a plain step's `run`: divide by zero as kernels do, keep covariances as the compiled one does."""

    def taken(*arguments: Any) -> int:
        """Take readings one at a time, with the arguments of the compiled `run`; returns how many were taken."""
        *records, readings, reports, covariances = arguments
        tracks = records[0]
        nothing = covariances[:0]
        with np.errstate(all="ignore"):
            for k in range(readings.shape[0]):
                if not run(*records, readings[k : k + 1], reports[k : k + 1], nothing):
                    return k
                if covariances.shape[0] > 0:
                    covariances[k] = tracks[0]["P"][0]
        return int(readings.shape[0])

    return taken
