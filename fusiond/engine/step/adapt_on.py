"""The hooks of the step where the configuration asks for adaptation. `assembly` copies this over `adapt.py`.

Three R for each channel: declared, trusted (gate and update) and slow (monitors; the gate where it is the larger). The
primary filter estimates for itself, and so does a filter that hears one sensor alone; a filter that leaves a sensor out
weighs the others as the primary one does. A reading that the gate refuses still counts; what a suspect or excluded
sensor says does not.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.adapt.guards import held
from fusiond.adapt.records import OWN, PRIMARY
from fusiond.adapt.slow import slow_ratio, slow_start
from fusiond.engine.records import CENTRAL
from fusiond.numerics.kernel import kernel
from fusiond.numerics.ud import ud_add, ud_projected
from fusiond.types import Health

from .guard import fuse
from .levels import fuse_levels, predict_levels
from .method import begin, weigh
from .sizes import BINS, ERRORS, SENSORS

EXCLUDED, PROBATION = int(Health.EXCLUDED), int(Health.PROBATION)
PRIMARILY, ALONE = int(PRIMARY), int(OWN)


@kernel
def begin_noise(track: Any, design: Any) -> None:
    """Begin with what is declared, or with what is known of the sensor already."""
    noise, made = track.noise, design.noise
    for sensor in range(SENSORS):
        for i in range(design.dof[sensor]):
            if not noise.begun[sensor]:
                noise.slow[sensor, i] = 1.0
                noise.slow_weight[sensor, i] = slow_start(made.slow_forget)
            for k in range(2):
                if not noise.begun[sensor]:
                    noise.trusted[k, sensor, i] = 1.0
                begin(noise.memory[k, sensor, i], made, sensor, i, noise.trusted[k, sensor, i])
            noise.used[sensor, i] = noise.trusted[PRIMARILY, sensor, i]
            noise.slow_mean[sensor, i] = 0.0
        noise.frozen[sensor] = 0
        noise.begun[sensor] = 1


@kernel
def prepare(track: Any, design: Any, work: Any, row: int, t_ns: int) -> None:
    """The bins go with the primary filter."""
    if row == CENTRAL:
        predict_levels(track, design, work, t_ns)


@kernel
def learns(track: Any, design: Any, row: int, sensor: int) -> bool:
    """Whether what the sensor says now tells of its noise: not while it may err otherwise, or is not used."""
    if not design.noise.adapts[sensor]:
        return False
    health = track.reaction.health[sensor]
    out = health == EXCLUDED or health == PROBATION
    return row != CENTRAL or not (out or track.noise.frozen[sensor])


@kernel
def trust(track: Any, design: Any, work: Any, row: int, sensor: int) -> None:
    """Scale work.R_d by the trusted ratio; keep the declared variances in work.noise.declared."""
    work.noise.width = 1.0
    for i in range(design.dof[sensor]):
        work.noise.declared[i] = work.R_d[i]
        if row == CENTRAL:
            work.R_d[i] *= track.noise.trusted[PRIMARILY, sensor, i]
        elif design.alone[row]:
            work.R_d[i] *= track.noise.trusted[ALONE, sensor, i]
        else:
            work.R_d[i] *= track.noise.used[sensor, i]


@kernel
def declared_variance(track: Any, work: Any, sensor: int, i: int, variance: float) -> float:
    """The declared variance of raw channel i, of which `variance` is used."""
    total = work.noise.declared[i]
    for j in range(i + 1, work.R_d.shape[0]):
        total += work.R_U[i, j] * work.R_U[i, j] * work.noise.declared[j]
    return total / (1.0 + track.reaction.noise_excess[sensor])


@kernel
def note_slowly(track: Any, design: Any, work: Any, sensor: int, i: int, nu: float, through: float) -> None:
    """Move the slow ratio of channel i on; write what it expects of the innovation into work.noise.slow_root."""
    noise, made, declared = track.noise, design.noise, work.noise.declared[i]
    work.noise.slow_own[i] = noise.slow[sensor, i] * declared
    work.noise.slow_root[i] = np.sqrt(through + work.noise.slow_own[i])
    if not learns(track, design, CENTRAL, sensor) or not declared > 0.0:
        return
    scaled = nu / np.sqrt(declared)
    before, weight, mean = noise.slow[sensor, i], noise.slow_weight[sensor, i], noise.slow_mean[sensor, i]
    ratio = slow_ratio(before, weight, made.slow_forget, scaled, mean, made.mean_share, through / declared)
    noise.slow[sensor, i] = held(ratio, before, made.floor[sensor, i], made.ceiling[sensor, i], made.most)
    noise.slow_weight[sensor, i] = made.slow_forget * weight + 0.5
    noise.slow_mean[sensor, i] += made.mean_share * (scaled - mean)


@kernel
def estimate(
    track: Any, design: Any, work: Any, row: int, sensor: int, i: int, nu: float, through: float
) -> None:
    """Let the method weigh channel i: its R for this update into work.R_d, what to add into work.noise.weighed[2]."""
    noise, made, declared = track.noise, design.noise, work.noise.declared[i]
    k = PRIMARILY if row == CENTRAL else ALONE
    said = work.noise.weighed
    said[2] = 0.0
    before = noise.trusted[k, sensor, i]
    if learns(track, design, row, sensor) and declared > 0.0:
        weigh(
            noise.memory[k, sensor, i],
            made,
            sensor,
            i,
            before,
            nu / np.sqrt(declared),
            through / declared,
            said,
        )
        lowest, highest = made.floor[sensor, i], made.ceiling[sensor, i]
        noise.trusted[k, sensor, i] = held(said[1], before, lowest, highest, made.most)
        work.R_d[i] = declared * min(max(said[0], lowest), highest)
        said[2] /= declared
    if row == CENTRAL:
        noise.used[sensor, i] = work.R_d[i] / declared if declared > 0.0 else before


@kernel
def fuse_channel(track: Any, design: Any, work: Any, row: int, sensor: int, i: int, nu: float) -> float:
    """Fuse channel i into filter `row`; returns the S of its gain, writes the gain times S into work.b."""
    through = ud_projected(track.U[row], track.d[row], work.H[i])
    work.noise.root[i] = np.sqrt(through + work.R_d[i])
    widen_gate(track, work, sensor, i, through)
    if row == CENTRAL:
        note_slowly(track, design, work, sensor, i, nu, through)
        if BINS > 0:
            return fuse_levels(track, design, work, sensor, nu, learns(track, design, row, sensor))
    elif not design.alone[row]:
        return fuse(track.U[row], track.d[row], sensor, i, nu, design, work)
    estimate(track, design, work, row, sensor, i, nu, through)
    S = fuse(track.U[row], track.d[row], sensor, i, nu, design, work)
    if work.noise.weighed[2] > 0.0:
        for j in range(ERRORS):
            work.a[j] = work.b[j]
        ud_add(track.U[row], track.d[row], work.a, work.noise.weighed[2])
    return S


@kernel
def widen_gate(track: Any, work: Any, sensor: int, i: int, through: float) -> None:
    """Note how much wider channel i's innovation would be with the slow R, where that is the larger.

    An estimate that follows within tens of readings is sometimes a third too low, and a reading is not to be refused
    for that. As before the reading, which cannot widen its own gate.
    """
    narrow, wide = through + work.R_d[i], through + track.noise.slow[sensor, i] * work.noise.declared[i]
    if narrow > 0.0:
        work.noise.width = max(work.noise.width, wide / narrow)


@kernel
def gate_width(work: Any) -> float:
    """By how much the squared distance from which a reading is refused is larger than with the trusted R."""
    return work.noise.width


@kernel
def root_of(work: Any, i: int, S: float) -> float:
    """Deviation that is expected of channel i's innovation with the trusted R."""
    return work.noise.root[i]


@kernel
def scale_slowly(track: Any, work: Any, sensor: int, dof: int) -> None:
    """The monitors judge work.e, root by the slow R, which is work.own."""
    for i in range(dof):
        work.own[i] = work.noise.slow_own[i]
        root = work.noise.slow_root[i]
        work.e[i] = work.e[i] * work.root[i] / root if root > 0.0 else 0.0
        work.root[i] = root
