"""What the monitors remember, what they were designed to, and what has been decided: three flat records.

All zeros is the neutral value of every field, so that a fresh track needs no other start.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fusiond.numerics.packed import packed


def monitor_dtype(
    *, states: int, errors: int, inputs: int, sensors: int, payload: int, cells: int, filters: int = 1
) -> np.dtype[Any]:
    """State of every test on the innovations of the primary filter.

    entries: readings written to the window so far.   alarm: which test asks for judgement (types.Alarm), 0 none;
    alarm_sensor: of which sensor, where the test says so;   alarm_cell: which cell, or of the pooled variance 1 where
    it is less than declared.
    carried: (n, n + inputs) transition of the error since the last entry, beside its response to a unit error of
    each input held meanwhile.   x_after, t_after_ns, rate: state after the last entry, its time, and its rate of
    change (1/s) predicted since.
    phi: (n, cells) error of the estimate that a unit fault of each cell has caused since the cell's onset;
    llr: its log likelihood ratio;   count: readings of its sensor since then.
    variance, white: (s, 2) tests up and down of each sensor;   pooled: (2,) of all together.
    last_e: whitened innovations of the sensor's last reading.   slow: its slow innovation variance less one.
    raw_z: last values sent;   repeats: whether the last reading was sent with the same ones;   rests: and with zeros
    alone;   pairs, equal: readings that could and that did repeat them, the current run left out;
    run: equal values in a row;   run_h: what was predicted when the run began.
    held: how often a value held between fixes was repeated;   held_longest: the most of that so far.
    usual: slow mean of an input, what it is taken to be without its sensor;   usual_var: slow variance about it;
    odd, odd_count: (inputs,) largest square of its deviations from it since the last entry, in such variances, and how
    many were odd;   away, away_count: sum of these deviations, and how many.   refused: (filters, s) readings of a
    sensor in a row that the gate of each filter refused,   shut_until_ns: until when it does at least.
    shadow: (s, 3) evidence that an excluded sensor has healed.
    """
    n, s, m, c = errors, sensors, payload, cells
    return packed([
        ("entries", "<i8"), ("alarm", "<i8"), ("alarm_sensor", "<i8"), ("alarm_cell", "<i8"),
        ("carried", "<f8", (n, n + inputs)), ("x_after", "<f8", (states,)), ("t_after_ns", "<i8"),
        ("rate", "<f8", (n,)),
        ("phi", "<f8", (n, c)), ("llr", "<f8", (c,)), ("count", "<i8", (c,)),
        ("variance", "<f8", (s, 2)), ("pooled", "<f8", (2,)), ("white", "<f8", (s, 2)), ("last_e", "<f8", (s, m)),
        ("slow", "<f8", (s,)), ("raw_z", "<f8", (s, m)), ("repeats", "<i8", (s,)), ("rests", "<i8", (s,)),
        ("pairs", "<i8", (s,)), ("equal", "<i8", (s,)),
        ("usual", "<f8", (s, m)), ("usual_var", "<f8", (s, m)),
        ("odd", "<f8", (inputs,)), ("odd_count", "<i8", (inputs,)), ("away", "<f8", (inputs,)),
        ("away_count", "<i8", (inputs,)), ("run", "<i8", (s,)),
        ("run_h", "<f8", (s, m)), ("held", "<i8", (s,)), ("held_longest", "<i8", (s,)),
        ("refused", "<i8", (filters, s)), ("shut_until_ns", "<i8", (filters, s)), ("shadow", "<f8", (s, 3)),
    ])  # fmt: skip


def tests_dtype(*, sensors: int, cells: int) -> np.dtype[Any]:
    """Thresholds of every test, derived at design time.

    Cells (`cell_*`, sorted by sensor): theta: signed fault size, in the channel's unit (or the input's);
    tolerance: error of that kind which is no fault, same unit;   channel: raw channel, or number of the input; -1: all;
    kind: a bias, or all channels' common scale or delay;
    limit: of its llr;   age: readings after which it starts anew.
    first, last: (s,) the cells of each sensor are first <= cell < last.   is_input: whether the sensor drives.
    gate: (s,) largest nis that is used;   variance_limit, white_limit: (s, 2);   pooled_limit: (2,).
    repeat_log: log of the wanted readings between false alarms of the frozen test.
    dead_band: (s,) mean of a whitened innovation that is no fault.   studentise: (s,) share of one reading in the slow
    variance, 0 where the declared noise is believed.   usual_share: of one reading in the usual value of an input.
    """
    s, c = sensors, cells
    return packed([
        ("theta", "<f8", (c,)), ("tolerance", "<f8", (c,)), ("channel", "<i8", (c,)),
        ("kind", "<i8", (c,)), ("limit", "<f8", (c,)), ("age", "<i8", (c,)),
        ("first", "<i8", (s,)), ("last", "<i8", (s,)), ("is_input", "<i8", (s,)),
        ("gate", "<f8", (s,)), ("variance_limit", "<f8", (s, 2)), ("white_limit", "<f8", (s, 2)),
        ("pooled_limit", "<f8", (2,)), ("repeat_log", "<f8"), ("dead_band", "<f8", (s,)), ("studentise", "<f8", (s,)),
        ("usual_share", "<f8", (s,)),
    ])  # fmt: skip


def reaction_dtype(*, sensors: int, payload: int) -> np.dtype[Any]:
    """What has been decided about every sensor, and what the estimator does about it.

    health: types.Health;   kind: types.Kind;   size, size_std: in the channel's unit (drift: per second; noise, scale:
    a factor; delay: s);   channel: raw channel, -1 all;   onset_ns, since_ns: when it began, when it was named;
    suspects: bit k set where it cannot be told from a fault of sensor k.
    excluded: its readings from out_from_ns to until_ns (0: for good) correct nothing.   relapses: how often it has come
    back.   from_ns, to_ns: (s, 2) the error taken off before, and now (0: none; 0: for good): offset, drift (per
    second since from_ns), gain_error (a factor less one) and lag, s.   noise_excess: its R is this much larger, a
    factor less one.   revisions: how often its error became another one;   barred_ns, barred: until when nothing is
    taken off it, and how often that was so.   shadow_size: bias, in the channel's unit, that would still be a fault
    when it asks to return; shadow_gain, shadow_lag: the same of a scale and a delay.   model: 1 while the model, not a
    sensor, is thought wrong.
    """
    s, m = sensors, payload
    return packed([
        ("health", "<i8", (s,)), ("kind", "<i8", (s,)), ("channel", "<i8", (s,)), ("size", "<f8", (s,)),
        ("size_std", "<f8", (s,)), ("onset_ns", "<i8", (s,)), ("since_ns", "<i8", (s,)), ("suspects", "<u8", (s,)),
        ("excluded", "<i8", (s,)), ("out_from_ns", "<i8", (s,)), ("until_ns", "<i8", (s,)),
        ("relapses", "<i8", (s,)), ("from_ns", "<i8", (s, 2)), ("to_ns", "<i8", (s, 2)), ("offset", "<f8", (s, 2, m)),
        ("drift", "<f8", (s, 2, m)), ("gain_error", "<f8", (s, 2, m)), ("lag", "<f8", (s, 2, m)),
        ("noise_excess", "<f8", (s,)), ("revisions", "<i8", (s,)),
        ("barred_ns", "<i8", (s,)), ("barred", "<i8", (s,)),
        ("shadow_size", "<f8", (s, m)), ("shadow_gain", "<f8", (s, m)), ("shadow_lag", "<f8", (s, m)), ("model", "<i8"),
    ])  # fmt: skip
