"""Which directions of the state a stack of readings sees."""

from __future__ import annotations

import numpy as np

from fusiond.numerics.ud import Matrix, Vector


def blind_share(rows: Matrix, tolerance: float = 1e-9) -> tuple[int, Vector]:
    """Rank of a stack of rows H F^k, and how much of each state it cannot see.

    Columns are scaled to equal length first, so that the units of the states do not matter.

    Args:
        rows: (k, n).   tolerance: singular values below this share of the largest count as zero.
    Returns:
        rank, and (n,) the part of each unit vector that lies in the null space: 0 observed, 1 unseen.
    """
    n = rows.shape[1]
    lengths = np.linalg.norm(rows, axis=0)
    scaled = rows / np.where(lengths > 0.0, lengths, 1.0)
    if not np.any(scaled):
        return 0, np.ones(n)
    _, singular, directions = np.linalg.svd(scaled)
    rank = int(np.sum(singular > tolerance * singular[0]))
    unseen = directions[rank:]
    return rank, np.sqrt(np.sum(unseen * unseen, axis=0))
