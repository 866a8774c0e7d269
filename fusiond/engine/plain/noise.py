"""A plain step whose R is as declared: the hooks of `looking`, each doing nothing.

`assembly` copies `noise_on.py` over this file where the configuration asks for adaptation.
"""

from __future__ import annotations

from typing import Any

from fusiond.filters.innovation import Matrix


def trusted(track: Any, design: Any, work: Any, row: int, reading: Any, P: Matrix) -> None:
    """work.nu, H, R_U, R_d are those of a reading that is about to correct filter `row`, whose covariance is P."""


def declared(work: Any, i: int, variance: float) -> float:
    """The declared variance of raw channel i, of which `variance` is used."""
    return variance
