"""A filter for each bin of levels of the only updating sensor's noise. `assembly` copies this over `levels.py`.

Rows 1 to BINS of the bank are the bins' filters; row 0 is their mixture, matched in its first two moments, and so is
the bins' common past: what is mixed into a bin is row 0 (`fusiond.adapt.bins`).
"""

from __future__ import annotations

from typing import Any

from fusiond.adapt.bins import add_moments, blend
from fusiond.adapt.guards import held
from fusiond.adapt.interacting import likelihoods, moments
from fusiond.numerics.discretise import wrap_angle
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import bierman_update, ud_add, ud_compose, ud_factor, ud_projected

from .monitor import is_excluded
from .predict import predict
from .sizes import BINS, ERRORS

LEAST = 1e-12
"""A bin less probable than this has no moments of its own."""


@kernel
def predict_levels(track: Any, design: Any, work: Any, t_ns: int) -> None:
    """Bring every bin to the time of the reading."""
    for b in range(BINS):
        predict(track, design, work, b + 1, t_ns)


@kernel
def gap_to(track: Any, design: Any, row: int, gap: Any) -> None:
    """Write how far filter `row` is from row 0."""
    for j in range(ERRORS):
        gap[j] = track.x[row, j] - track.x[0, j]
        if design.angle[j]:
            gap[j] = wrap_angle(gap[j])


@kernel
def mix(track: Any, design: Any, work: Any, b: int, own: float, P: Any) -> None:
    """Let what jumps into bin b in: its moments become those of itself, weighing `own`, and of row 0 (P)."""
    row, gap = b + 1, work.noise.shift[b]
    if not own > LEAST:
        for j in range(ERRORS):
            gap[j] = 0.0
            track.d[row, j] = track.d[0, j]
            for k in range(j):
                track.U[row, k, j] = track.U[0, k, j]
        return
    gap_to(track, design, row, gap)
    blend(track.U[row], track.d[row], gap, own, P, work.noise.mixed)
    for j in range(ERRORS):
        gap[j] *= own


@kernel
def expect(track: Any, design: Any, work: Any, b: int, nu: float, declared: float, learning: bool, shift: float) -> float:
    """Write the weights of bin b's levels after the reading, not normalised, into work.noise.likely; returns their sum.

    Args:
        nu: innovation of row 0.   shift: taken off every exponent.
    """
    made, gap = design.noise, work.noise.shift[b]
    memory, sensor = track.noise.memory[0, work.noise.sensor, 0], work.noise.sensor
    first, last = made.bin_first[b], made.bin_first[b + 1]
    if not learning:
        total = 0.0
        for i in range(first, last):
            work.noise.likely[i] = memory[i]
            total += memory[i]
        return total
    for j in range(ERRORS):
        nu -= work.H[0, j] * gap[j]
    through = ud_projected(track.U[b + 1], track.d[b + 1], work.H[0]) / declared
    return likelihoods(
        memory, made.level, made.jump[sensor, 0], first, last, 1.0 - made.hazard, made.hazard,
        nu * nu / declared, through, shift, work.noise.likely,
    )  # fmt: skip


@kernel
def correct_bin(track: Any, design: Any, work: Any, b: int, nu: float, declared: float, share: float) -> None:
    """Update bin b, which the reading has left with probability `share`; add its gain to work.noise.gain."""
    made, row, gap, said = design.noise, b + 1, work.noise.shift[b], work.noise.weighed
    through = ud_projected(track.U[row], track.d[row], work.H[0]) / declared
    moments(
        work.noise.likely, made.level, made.bin_first[b], made.bin_first[b + 1], work.noise.bin[b], through, said
    )
    for j in range(ERRORS):
        nu -= work.H[0, j] * gap[j]
    r, spread = (1.0 / said[0] - through) * declared, said[1] * nu * nu / (declared * declared)
    S = bierman_update(gap, track.U[row], track.d[row], work.H[0], r, nu, work.a, work.b)
    for j in range(ERRORS):
        work.noise.gain[j] += share * work.b[j] / S
        work.a[j] = work.b[j]
    ud_add(track.U[row], track.d[row], work.a, spread)


@kernel
def match(track: Any, design: Any, work: Any, total: float) -> None:
    """Set U, d of row 0 and work.dx, by which its mean moves, to the mixture of the bins, and place the bins' means."""
    P = work.noise.P
    for i in range(ERRORS):
        for j in range(ERRORS):
            P[i, j] = 0.0
    for b in range(BINS):
        for j in range(ERRORS):
            work.dx[j] += work.noise.bin[b] / total * work.noise.shift[b, j]
    for b in range(BINS):
        for j in range(ERRORS):
            place = track.x[0, j] + work.noise.shift[b, j]
            track.x[b + 1, j] = wrap_angle(place) if design.angle[j] else place
            work.noise.gap[j] = work.noise.shift[b, j] - work.dx[j]
        share = work.noise.bin[b] / total
        add_moments(track.U[b + 1], track.d[b + 1], work.noise.gap, share, work.noise.mixed, P)
    ud_factor(P, track.U[0], track.d[0], 1e-9)


@kernel
def learn_levels(track: Any, design: Any, work: Any, sensor: int, total: float) -> None:
    """Keep the weights of all levels, and their mean as the trusted ratio."""
    made, noise = design.noise, track.noise
    ratio = 0.0
    for i in range(made.level.shape[0]):
        noise.memory[0, sensor, 0, i] = work.noise.likely[i] / total
        ratio += made.level[i] * noise.memory[0, sensor, 0, i]
    before, lowest, highest = noise.trusted[0, sensor, 0], made.floor[sensor, 0], made.ceiling[sensor, 0]
    noise.trusted[0, sensor, 0] = held(ratio, before, lowest, highest, made.most)


@kernel
def fuse_levels(track: Any, design: Any, work: Any, sensor: int, nu: float, learning: bool) -> float:
    """Fuse the only channel into every bin and mix them into row 0; returns S, writes the gain times S into work.b.

    Reads work.nu, H, noise.declared, noise.root; writes work.dx, x, U, d of the bins, U, d of row 0, and what is
    remembered of the noise. A reading that the gate refuses, or of an excluded sensor, moves no estimate.
    """
    made, noise, memory = design.noise, work.noise, track.noise.memory[0, sensor, 0]
    declared, S = noise.declared[0], noise.root[0] * noise.root[0]
    noise.sensor = sensor
    hazard = made.hazard if learning else 0.0
    ud_compose(track.U[0], track.d[0], noise.P)
    top = made.level[made.level.shape[0] - 1]
    shift = 0.5 * nu * nu / (S - track.noise.trusted[0, sensor, 0] * declared + top * declared)
    total = 0.0
    for b in range(BINS):
        stays, jumps = 0.0, 0.0
        for i in range(made.bin_first[b], made.bin_first[b + 1]):
            stays += (1.0 - hazard) * memory[i]
            jumps += hazard * made.jump[sensor, 0, i]
        mix(track, design, work, b, stays / (stays + jumps) if stays > 0.0 else 0.0, noise.P)
        noise.bin[b] = expect(track, design, work, b, nu, declared, learning, shift)
        total += noise.bin[b]
    gate = design.tests.gate[sensor]
    refused = (gate > 0.0 and nu * nu > gate * S) or is_excluded(track, sensor, track.t_ns)
    for j in range(ERRORS):
        noise.gain[j] = 0.0
    if refused:
        for b in range(BINS):
            for j in range(ERRORS):
                place = track.x[0, j] + noise.shift[b, j]
                track.x[b + 1, j] = wrap_angle(place) if design.angle[j] else place
    else:
        for b in range(BINS):
            if noise.bin[b] > LEAST * total:
                correct_bin(track, design, work, b, nu, declared, noise.bin[b] / total)
        match(track, design, work, total)
    if learning:
        learn_levels(track, design, work, sensor, total)
    track.noise.used[sensor, 0] = track.noise.trusted[0, sensor, 0]
    for j in range(ERRORS):
        work.b[j] = noise.gain[j] * S
    return S
