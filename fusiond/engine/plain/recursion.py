"""One filter's update by the configured recursion, its covariance watched by the guard."""

from __future__ import annotations

from typing import Any

from fusiond.filters import conventional, information, ud
from fusiond.filters.innovation import Innovation, Matrix, Vector
from fusiond.numerics.covariance import ROUNDING, examine, repair

from .choices import POLICY, RECURSION

UPDATES = {
    "ud": ud.update,
    "conventional": conventional.update,
    "information": information.update,
    "seed": information.update_by_inverse,
}
INVERTS = RECURSION == "seed"
"""Whether the recursion inverts its prior, which must then have full rank."""


def guarded(track: Any, design: Any, P: Matrix, before: Matrix, *, regular: bool = False) -> Matrix:
    """P, repaired where it is not sound. Writes track.repairs, unsound, repair_*, condition, drawn.

    Args:
        before: (n, n) the last covariance known to be sound.   regular: it is about to be inverted.
    """
    seen = examine(P)
    if seen.smallest > ROUNDING:
        track.condition = max(track.condition, seen.condition)
    if seen.sound(regular):
        return 0.5 * (P + P.T)
    diagonal = design.draws[track.drawn % design.draws.shape[0]]
    fixed = repair(P, POLICY, before=before, diagonal=diagonal, regular=regular)
    track.drawn += 1
    track.repairs += 1
    track.unsound += not fixed.sound
    track.repair_size = max(track.repair_size, fixed.size)
    track.repair_last = fixed.size
    return fixed.P


def condition(track: Any, design: Any, x: Vector, P: Matrix, seen: Innovation) -> tuple[Vector, Matrix]:
    """Condition one estimate on one innovation; returns the new one."""
    prior = guarded(track, design, P, P, regular=True) if INVERTS else P
    after, covariance = UPDATES[RECURSION](x, prior, seen)
    return after, guarded(track, design, covariance, prior)
