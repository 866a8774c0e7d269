"""One channel of an update where states are guarded: what cannot be observed right now is not learned.

A filter linearised at its own estimate takes noise for motion. A reading of velocity tells of the heading by
s = P_psi h / P_psi_psi per radian, and s is the estimated velocity, turned by a right angle: of a body that stands
still, nothing but the error of that estimate. Each reading adds s^2 to the information on the heading, and so on the
bias of the gyro that turns it: 300 s of standing still seem to show north to 0.16 rad to a filter that is 1.6 rad off.

So s is held against its own standard deviation: the error of a vector of the world, turned. With h~ the row h whose
horizontal pairs are turned by a right angle, var s = h~ (P - P_psi P_psi' / P_psi_psi) h~': the part that the heading
itself explains is no noise. A guarded state j is corrected by the channel only where

    (P_j h)^2 > CERTAIN^2 (P_j_psi)^2 var s

which for the heading is s^2 > CERTAIN^2 var s, and for what reaches the reading through the heading the same, by the
chain rule. Where not, j is considered, not estimated (Schmidt 1966): its gain is zero; and since a gain that is g off
the best one costs S g g', that is added back. Its variance is then what it was, and its correlations go on. Readings
that cannot tell one heading from another in any state (design.free) teach whatever they see.
Law: tests/laws/test_unobserved.py. Both sides: tests/scenarios/test_observability_guard.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.numerics.arrays import copy_vector
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import bierman_update, ud_add, ud_covariance, ud_projected, ud_variance

from .sizes import ERRORS, GUARDED

CERTAIN = 3.0
"""Deviations of its own error by which a sensitivity must differ from zero to be believed."""
MEMORY_S = 10.0
"""Learning is weighed over about this long."""
LEAST = 0.01
"""Of its variance: a state that all readings of that time reduce by less is reported as unobserved."""


@kernel
def doubt(U: Any, d: Any, h: Any, design: Any, work: Any) -> float:
    """var s, (unit of z / rad)^2, of one channel; 0 where it reads no vector of the world."""
    for j in range(ERRORS):
        work.a[j] = 0.0
    reads = False
    for j in range(ERRORS):
        other = design.turns_to[j]
        if other >= 0 and h[other] != 0.0:
            work.a[j] = design.turns_by[j] * h[other]
            reads = True
    if not reads:
        return 0.0
    variance = ud_projected(U, d, work.a)
    heading = ud_variance(U, d, design.heading)
    if heading > 0.0:
        along = 0.0
        for j in range(ERRORS):
            if work.a[j] != 0.0:
                along += work.a[j] * ud_covariance(U, d, j, design.heading)
        variance -= along * along / heading
    return max(variance, 0.0)


@kernel
def withhold(U: Any, d: Any, limit: float, S: float, nu: float, design: Any, work: Any) -> None:
    """Take back what the channel did to guarded states whose P_j h is within limit times their P_j_psi."""
    some = False
    for g in range(GUARDED):
        j = design.guarded[g]
        if abs(work.b[j]) <= limit * abs(work.through[g]):
            work.dx[j] -= work.b[j] / S * nu
            work.withheld[j] = work.b[j]
            work.b[j] = 0.0
            some = True
    if some:
        copy_vector(work.withheld, work.a)
        ud_add(U, d, work.a, 1.0 / S)


@kernel
def fuse(U: Any, d: Any, sensor: int, i: int, nu: float, design: Any, work: Any) -> float:
    """Fuse channel i of work.H, R_d into U, d and work.dx; returns S.

    Writes the gain used, times S, into work.b and the part of the best gain that was not used into work.withheld.
    """
    for j in range(ERRORS):
        work.withheld[j] = 0.0
    h = work.H[i]
    variance = 0.0 if design.free[sensor] else doubt(U, d, h, design, work)
    if variance > 0.0:
        for g in range(GUARDED):
            work.through[g] = ud_covariance(U, d, design.guarded[g], design.heading)
    S = bierman_update(work.dx, U, d, h, work.R_d[i], nu, work.a, work.b)
    if variance > 0.0 and S > 0.0:
        withhold(U, d, CERTAIN * np.sqrt(variance), S, nu, design, work)
    return S


@kernel
def faded(track: Any, now_ns: int) -> float:
    """What is left of track.learned at now_ns."""
    return float(np.exp(-max(0, now_ns - track.learned_ns) / (MEMORY_S * 1e9)))


@kernel
def note_learning(track: Any, design: Any, work: Any, S: float) -> None:
    """Add to track.learned the part of its variance that the last channel, of the centralized filter, took away."""
    if not S > 0.0:
        return
    left = faded(track, track.t_ns)
    track.learned_ns = track.t_ns
    for g in range(GUARDED):
        j = design.guarded[g]
        gone = work.b[j] * work.b[j] / S
        before = ud_variance(track.U[0], track.d[0], j) + gone
        track.learned[g] = track.learned[g] * left + (gone / before if before > 0.0 else 0.0)


@kernel
def begin_learning(track: Any, work: Any) -> None:
    """Before the channels of one reading."""
    work.learned_ns = track.learned_ns
    copy_vector(track.learned, work.learned)


@kernel
def forget_learning(track: Any, work: Any) -> None:
    """The channels noted since `begin_learning` were not used after all."""
    track.learned_ns = work.learned_ns
    copy_vector(work.learned, track.learned)


@kernel
def unobserved_states(track: Any, design: Any, now_ns: int) -> int:
    """The guarded states that nothing teaches now, a bit for each slot of the error."""
    left = faded(track, now_ns)
    bits = 0
    for g in range(GUARDED):
        if track.learned[g] * left < LEAST:
            bits |= 1 << design.guarded[g]
    return bits
