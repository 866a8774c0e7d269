"""States that are angles, of which some live on a circle."""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.engine.step.sizes import STATES
from fusiond.filters.innovation import Vector
from fusiond.numerics.discretise import wrap_angle


def wrap(design: Any, x: Vector) -> Vector:
    """x with its angles in [-pi, pi)."""
    return np.array([wrap_angle(x[i]) if design.angle[i] else x[i] for i in range(STATES)])


def near(design: Any, x: Vector, other: Vector) -> Vector:
    """x with its angles counted from those of `other`, so that two either side of pi can be averaged."""
    return np.where(design.angle != 0, other + wrap(design, x - other), x)
