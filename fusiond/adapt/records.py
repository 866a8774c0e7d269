"""What is remembered of every sensor's noise, and what its estimation was designed to: two flat records.

All variances are ratios to the declared one, channel by channel after decorrelation, so that a reading that declares
its own R is served as well, and a floor of 0.01 means the same for metres and for radians.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fusiond.numerics.packed import packed

PRIMARY, OWN = 0, 1
"""Which filter's innovations an estimate rests on: the primary filter's, or those of the sensor's own local filter."""


@dataclass(frozen=True, slots=True)
class AdaptShape:
    """Sizes of the records of one configuration's noise estimation.

    Args:
        memory: numbers that the method remembers of a channel.   levels: of the ladder of ratios (interacting).
        bins: filters that share the ladder, rows of the bank (0: one filter).   rows, columns: of the fuzzy table.
    """

    memory: int = 1
    levels: int = 1
    bins: int = 0
    rows: int = 2
    columns: int = 2


def noise_dtype(shape: AdaptShape, *, sensors: int, payload: int) -> np.dtype[Any]:
    """State of the noise of every sensor.

    begun: whether the sensor's fields hold something; what was learnt outlives a reset.
    memory: (2, s, m, k) what the method remembers, from the innovations of the primary filter and, apart from them, of
    the sensor's own.   trusted: (2, s, m) R / declared for the next reading: gate and update.   used: (s, m) the R /
    declared that weighed the primary filter's last update.
    slow: (s, m) R / declared over hundreds of readings: the scale of the monitors.   slow_weight: readings it rests on,
    halved;   slow_mean: slow mean of the innovation, in declared deviations.
    frozen: whether an alarm is open that the sensor's noise does not explain.
    """
    s, m = sensors, payload
    return packed([
        ("begun", "<i8", (s,)), ("memory", "<f8", (2, s, m, shape.memory)), ("trusted", "<f8", (2, s, m)),
        ("used", "<f8", (s, m)), ("slow", "<f8", (s, m)), ("slow_weight", "<f8", (s, m)),
        ("slow_mean", "<f8", (s, m)), ("frozen", "<i8", (s,)),
    ])  # fmt: skip


def noise_design_dtype(shape: AdaptShape, *, sensors: int, payload: int) -> np.dtype[Any]:
    """Tables of the estimation, made at design time.

    adapts: (s,) whether the sensor's noise is estimated.   floor, ceiling: (s, m) smallest and largest ratio.
    most: largest change of the logarithm of a ratio from one reading to the next.
    forget: share of what variational inference remembers that is left after a reading;   slow_forget: the same of the
    slow ratio.   mean_share: of one reading in the slow mean.   window: readings of the fuzzy window.
    level: (l,) ladder of ratios;   jump: (s, m, l) where a ratio jumps to;   hazard: how often;   bin_first: (b + 1,)
    the levels of bin k are bin_first[k] <= i < bin_first[k + 1];   bin_jump: (b,) share of the jumps that end in it;
    binned: the sensor whose levels have bins.
    table: (rows, columns) fuzzy output where its inputs are row_at: (rows,) and column_at: (columns,), increasing.
    """
    s, m = sensors, payload
    return packed([
        ("adapts", "<i8", (s,)), ("floor", "<f8", (s, m)), ("ceiling", "<f8", (s, m)), ("most", "<f8"),
        ("forget", "<f8"), ("slow_forget", "<f8"), ("mean_share", "<f8"), ("window", "<f8"),
        ("level", "<f8", (shape.levels,)), ("jump", "<f8", (s, m, shape.levels)), ("hazard", "<f8"),
        ("bin_first", "<i8", (shape.bins + 1,)), ("bin_jump", "<f8", (shape.bins,)), ("binned", "<i8"),
        ("table", "<f8", (shape.rows, shape.columns)),
        ("row_at", "<f8", (shape.rows,)), ("column_at", "<f8", (shape.columns,)),
    ])  # fmt: skip


def noise_work_dtype(shape: AdaptShape, *, errors: int, payload: int) -> np.dtype[Any]:
    """Scratch of the estimation.

    declared: (m,) declared variances of the reading's channels;   weighed: (4,) what a method says of one channel;
    slow_root, slow_own: (m,) deviations of the innovations with the slow R, and that;   root: (m,) with
    the trusted one;   width: squared, how much wider the gate is where the slow one is larger.
    Of the bins: P, mixed: (n, n);   gap, gain: (n,);   shift: (b, n) how far each is from the prior of row 0;   bin:
    (b,) their weights;   likely: (l,) weights of the levels, not normalised;   sums: (b, 4) their moments.
    """
    n, m = errors, payload
    return packed([
        ("declared", "<f8", (m,)), ("weighed", "<f8", (4,)), ("slow_root", "<f8", (m,)), ("slow_own", "<f8", (m,)),
        ("root", "<f8", (m,)),
        ("width", "<f8"), ("P", "<f8", (n, n)), ("mixed", "<f8", (n, n)), ("gap", "<f8", (n,)), ("gain", "<f8", (n,)),
        ("shift", "<f8", (shape.bins, n)), ("likely", "<f8", (shape.levels,)), ("bin", "<f8", (shape.bins,)),
        ("sums", "<f8", (shape.bins, 4)),
    ])  # fmt: skip
