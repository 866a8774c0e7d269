"""A filter for each bin of levels of the only updating sensor's noise. `assembly` copies this over `levels.py`.

Rows 1 to BINS of the bank are the bins' filters; row 0 is their mixture, matched in its first two moments, and so is
the bins' common past: what is mixed into a bin is row 0 (`fusiond.adapt.bins`).
"""

from __future__ import annotations

from typing import Any

from fusiond.adapt.bins import add_moments, blend
from fusiond.adapt.guards import held
from fusiond.adapt.interacting import likelihoods, spread_of, unweighed
from fusiond.numerics.discretise import wrap_angle
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import bierman_update, ud_add, ud_compose, ud_factor, ud_projected

from .monitor import is_excluded
from .predict import predict
from .sizes import BINS, ERRORS

LEAST = 1e-5
"""A bin less probable than this keeps no moments of its own: what jumps into it outweighs them."""


@kernel
def predict_levels(track: Any, design: Any, work: Any, t_ns: int) -> None:
    """Bring every bin that has moments of its own to the time of the reading."""
    for b in range(BINS):
        if weight_of(track, design, b) >= LEAST:
            predict(track, design, work, b + 1, t_ns)
        else:
            track.filter_t_ns[b + 1] = track.filter_t_ns[0]


@kernel
def weight_of(track: Any, design: Any, b: int) -> float:
    """Probability of bin b."""
    total = 0.0
    for i in range(design.noise.bin_first[b], design.noise.bin_first[b + 1]):
        total += track.noise.memory[0, design.noise.binned, 0, i]
    return total


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
    if not own > 0.0:
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
def expect(
    track: Any, design: Any, work: Any, b: int, nu: float, declared: float, learning: bool, shift: float
) -> None:
    """Weigh the levels of bin b by the reading: work.noise.likely and sums[b], not normalised.

    Args:
        nu: innovation of row 0.   shift: added to every exponent.
    """
    made, gap, sums = design.noise, work.noise.shift[b], work.noise.sums[b]
    sensor, first, last = made.binned, made.bin_first[b], made.bin_first[b + 1]
    memory = track.noise.memory[0, sensor, 0]
    through = ud_projected(track.U[b + 1], track.d[b + 1], work.H[0]) / declared
    if not learning:
        unweighed(memory, made.level, first, last, through, work.noise.likely, sums)
        return
    for j in range(ERRORS):
        nu -= work.H[0, j] * gap[j]
    likelihoods(
        memory, made.level, made.jump[sensor, 0], first, last, made.hazard, nu * nu / declared, through, shift,
        work.noise.likely, sums,
    )  # fmt: skip


@kernel
def correct_bin(track: Any, work: Any, b: int, nu: float, declared: float) -> None:
    """Update bin b by its own levels; add its gain, weighed by work.noise.bin[b], to work.noise.gain."""
    row, gap, sums, share = b + 1, work.noise.shift[b], work.noise.sums[b], work.noise.bin[b]
    through = ud_projected(track.U[row], track.d[row], work.H[0])
    for j in range(ERRORS):
        nu -= work.H[0, j] * gap[j]
    r = declared * sums[0] / sums[1] - through
    S = bierman_update(gap, track.U[row], track.d[row], work.H[0], r, nu, work.a, work.b)
    for j in range(ERRORS):
        work.noise.gain[j] += share * work.b[j] / S
        work.a[j] = work.b[j]
    ud_add(track.U[row], track.d[row], work.a, spread_of(sums) * nu * nu / (declared * declared))


@kernel
def match(track: Any, design: Any, work: Any) -> None:
    """Set U, d of row 0 and work.dx, by which its mean moves, to the mixture of the bins, and place the bins' means."""
    P, share, shift = work.noise.P, work.noise.bin, work.noise.shift
    for i in range(ERRORS):
        for j in range(ERRORS):
            P[i, j] = 0.0
    for b in range(BINS):
        for j in range(ERRORS):
            work.dx[j] += share[b] * shift[b, j]
    for b in range(BINS):
        if share[b] > 0.0:
            for j in range(ERRORS):
                work.noise.gap[j] = shift[b, j] - work.dx[j]
            add_moments(track.U[b + 1], track.d[b + 1], work.noise.gap, share[b], work.noise.mixed, P)
    place(track, design, work)
    ud_factor(P, track.U[0], track.d[0], 1e-9)


@kernel
def place(track: Any, design: Any, work: Any) -> None:
    """Set the bins' means, which are work.noise.shift from that of row 0."""
    for b in range(BINS):
        for j in range(ERRORS):
            value = track.x[0, j] + work.noise.shift[b, j]
            track.x[b + 1, j] = wrap_angle(value) if design.angle[j] else value


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
    made, noise = design.noise, work.noise
    declared, S = noise.declared[0], noise.root[0] * noise.root[0]
    hazard = made.hazard if learning else 0.0
    ud_compose(track.U[0], track.d[0], noise.P)
    top = made.level[made.level.shape[0] - 1]
    shift = 0.5 * nu * nu / (S - track.noise.trusted[0, sensor, 0] * declared + top * declared)
    total = 0.0
    for b in range(BINS):
        own = weight_of(track, design, b)
        own = (1.0 - hazard) * own if own >= LEAST else 0.0
        mix(track, design, work, b, own / (own + hazard * made.bin_jump[b]) if own > 0.0 else 0.0, noise.P)
        expect(track, design, work, b, nu, declared, learning, shift)
        noise.bin[b] = noise.sums[b, 0]
        total += noise.bin[b]
    gate = design.tests.gate[sensor]
    refused = (gate > 0.0 and nu * nu > gate * noise.width * S) or is_excluded(track, sensor, track.t_ns)
    for j in range(ERRORS):
        noise.gain[j] = 0.0
    if refused:
        place(track, design, work)
    else:
        likely = 0.0
        for b in range(BINS):
            likely += noise.bin[b] if noise.bin[b] >= LEAST * total else 0.0
        for b in range(BINS):
            noise.bin[b] = noise.bin[b] / likely if noise.bin[b] >= LEAST * total else 0.0
            if noise.bin[b] > 0.0:
                correct_bin(track, work, b, nu, declared)
        match(track, design, work)
    if learning:
        learn_levels(track, design, work, sensor, total)
    track.noise.used[sensor, 0] = track.noise.trusted[0, sensor, 0]
    for j in range(ERRORS):
        work.b[j] = noise.gain[j] * S
    return S
