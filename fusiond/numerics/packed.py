"""Flat records: dtypes without padding, the same bytes on every machine."""

from __future__ import annotations

from typing import Any

import numpy as np


def packed(fields: list[tuple[Any, ...]]) -> np.dtype[Any]:
    """A record dtype whose scalars have attributes and whose subarrays have at least one element."""
    sized = [(*f[:2], tuple(max(1, k) for k in f[2])) if len(f) == 3 else f for f in fields]
    return np.dtype((np.record, sized))
