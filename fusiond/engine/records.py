"""The flat records: what a reading, a report and a track know, as documented numpy dtypes.

Everything the estimator remembers is one `track` record, so a snapshot is a copy, a checkpoint its bytes, a fleet
an array, and two runs are equal when their bytes are. All fields are little-endian.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from fusiond.adapt.records import AdaptShape, noise_design_dtype, noise_dtype, noise_work_dtype
from fusiond.faults.hearing import evidence_dtype
from fusiond.faults.records import monitor_dtype, reaction_dtype, tests_dtype
from fusiond.faults.window import window_dtype
from fusiond.numerics.packed import packed

HAS_SEQ = 1
"""Reading flag: `seq` was sent by the sensor."""
HAS_R = 2
"""Reading flag: `R` holds the covariance that came with the reading (unit of z squared)."""
FED = 8
"""Reading flag: nobody sent it, it is the engine's own command (engine.step.feed_on)."""
HAS_ARRIVAL = 4
"""Reading flag: `arrival_ns` was measured by a clock; without it nothing is known of when the reading came."""


CENTRAL = cast(int, np.int64(0))
"""Row of the centralized filter. A plain 0 is a type of its own to numba: every kernel would be compiled twice."""


TO_JUDGE = 1
"""desk.pause: a reading has been applied and has raised an alarm."""
JUDGED = 2
"""desk.pause: the alarm has been judged, its reading's report is to be finished."""
TO_REPLAY = 3
"""desk.pause: the ring is to be applied once more from desk.replay_from."""


@dataclass(frozen=True, slots=True)
class Shape:
    """Sizes of one configuration's records.

    Args:
        states: numbers in the state x.   errors: n, dimension of its covariance; fewer where the state is no
            vector (a quaternion has four numbers and three degrees of freedom).
        inputs: numbers that drive the prediction.     noises: columns of the noise matrix G.
        sensors: s, all sensors, inputs included.      filters: f, rows of the bank (engine.layout.FilterLayout).
        payload: most numbers any reading carries.     slots: most state slots any sensor model reads.
        model_parameters, sensor_parameters, law_parameters: lengths of the parameter vectors.
        controls, references: numbers of the command and of the reference (0 without control).
        memory, queue: numbers the law keeps, and room for commands that have not acted yet when the next is computed.
        feeds: 1 where the command drives the prediction, else 0.
        cells: of the bank of fault signatures; 0 without fault detection.   window: readings its evidence reaches back.
        protected: error slots with a protection level.
        guarded: g, states that are not learned while they cannot be observed.
        lazy: 1 where covariances follow more rarely than means, else 0.
        adapt: of the estimation of noise; None without.
    """

    states: int
    errors: int
    inputs: int
    noises: int
    sensors: int
    filters: int
    payload: int
    slots: int
    model_parameters: int
    sensor_parameters: int
    law_parameters: int
    controls: int
    references: int
    cells: int = 0
    window: int = 1
    protected: int = 0
    guarded: int = 0
    lazy: int = 0
    memory: int = 0
    queue: int = 0
    feeds: int = 0
    adapt: AdaptShape | None = None

    @property
    def monitor(self) -> np.dtype[Any]:
        """dtype of the monitors' state; without detection one of no more than a few numbers."""
        watched = self.cells > 0
        return monitor_dtype(
            states=self.states if watched else 1,
            errors=self.errors if watched else 1,
            inputs=self.inputs if watched else 1,
            sensors=self.sensors if watched else 1,
            payload=self.payload if watched else 1,
            cells=self.cells,
            filters=self.filters if watched else 1,
        )


def record(*fields: tuple[str, Any] | tuple[str, Any, tuple[int, ...]]) -> np.dtype[Any]:
    """As `packed`, of fields given one by one."""
    return packed(list(fields))


def reading_dtype(payload: int) -> np.dtype[Any]:
    """One reading or event. `sensor` is its number in the order of the configuration's sensors, or TICK or RESET.

    `length` is how many numbers were sent (z holds the first `payload` of them); `flags` see HAS_*.
    """
    return record(
        ("t_ns", "<i8"), ("arrival_ns", "<i8"), ("seq", "<u8"), ("sensor", "<i4"), ("length", "<i4"),
        ("flags", "<i8"), ("z", "<f8", (payload,)), ("R", "<f8", (payload, payload)),
    )  # fmt: skip


def report_dtype(shape: Shape) -> np.dtype[Any]:
    """What was decided about one reading, and the state after it.

    nu, S, R_used, R_declared: innovation z - h(x), diagonals of its covariance and of R, prior to the update.
    e: the innovation whitened channel by channel, unit variance under the model.  nis = sum e^2, dof terms.
    limit: largest nis the gate lets pass (infinite: no gate).   state_t_ns: time of x and std.
    health: of every sensor after the reading.   fault*, suspects, model: what is wrong with it (faults.records), its
    kind as types.Kind.   command_due: 1 where a command was computed.
    resets, jump: how often the state was set to its initial value, and by how much it jumped the last time (error
    slots: what leads from the estimate before to the one after).
    protection: levels of the protected slots (faults.protection), infinite before the first reading; the field is there
    only where any is protected.
    unobserved: guarded states that nothing teaches now, bit j for slot j of the error.
    """
    m, s, k, q = shape.payload, shape.sensors, shape.controls, shape.protected
    return record(
        ("t_ns", "<i8"), ("arrival_ns", "<i8"), ("seq", "<u8"), ("sensor", "<i4"), ("verdict", "<i4"),
        ("action", "<i4"), ("dof", "<i4"), ("length", "<i4"), ("service", "<i4"), ("health", "<i4", (s,)),
        ("z", "<f8", (m,)), ("nu", "<f8", (m,)), ("S", "<f8", (m,)), ("e", "<f8", (m,)),
        ("R_used", "<f8", (m,)), ("R_declared", "<f8", (m,)), ("nis", "<f8"), ("limit", "<f8"),
        ("state_t_ns", "<i8"), ("x", "<f8", (shape.states,)), ("std", "<f8", (shape.errors,)),
        ("resets", "<i8"), ("jump", "<f8", (shape.errors,)), ("unobserved", "<i8"),
        ("fault", "<i4", (s,)), ("fault_channel", "<i4", (s,)), ("fault_size", "<f8", (s,)), ("fault_std", "<f8", (s,)),
        ("fault_onset_ns", "<i8", (s,)), ("suspects", "<u8", (s,)), ("model", "<i4"),
        ("command_due", "<i4"), ("command_valid", "<i4"), ("command", "<f8", (k,)),
        *([("protection", "<f8", (q,))] if q else []),
    )  # fmt: skip


def track_dtype(shape: Shape) -> np.dtype[Any]:
    """Everything the estimator remembers. Row 0 of x, U, d is the centralized filter, the others hear fewer sensors.

    Each filter has its own time: it is predicted only when one of its own readings comes, so that leaving a sensor
    out is, bit for bit, a run that never had it. U (n, n) is unit upper triangular (only its upper part is meant),
    d >= 0; they are the covariance of the error of x.
    u: the inputs held now, u_var their variances.   sensor_t_ns: stamp of each sensor's last reading, held ones
    included; sensor_z: its last used one.   gap_from_ns, gap_to_ns: its last silence that was longer than healthy;
    gaps, late_gaps: seen so far, up to what is remembered of them;   late_share, late_excess_ns: step.silence;   live:
    whether its arrivals are known, noted where silences are learnt.
    resets, jump: as in the report.   reaction, monitor: faults.records.
    learned: of each guarded state, the part of its variance that readings took away lately, as of learned_ns.
    pending*: intervals since U, d were brought forward, with their transition and noise (step.pending_on).
    noise: adapt.records; the field is there only where noise is estimated.
    """
    n, f, s, m, ni = shape.errors, shape.filters, shape.sensors, shape.payload, shape.inputs
    z = shape.lazy
    return record(
        ("started", "<i8"), ("t_ns", "<i8"), ("start_ns", "<i8"), ("update_ns", "<i8"), ("resets", "<i8"),
        ("jump", "<f8", (n,)), ("learned", "<f8", (shape.guarded,)), ("learned_ns", "<i8"),
        ("pending", "<i8", (z * f,)), ("pending_F", "<f8", (z * f, z * n, z * n)),
        ("pending_Q", "<f8", (z * f, z * n, z * n)),
        ("filter_t_ns", "<i8", (f,)), ("x", "<f8", (f, shape.states)), ("U", "<f8", (f, n, n)), ("d", "<f8", (f, n)),
        ("u", "<f8", (ni,)), ("u_var", "<f8", (ni,)),
        ("sensor_seen", "<i8", (s,)), ("sensor_t_ns", "<i8", (s,)), ("sensor_z", "<f8", (s, m)),
        ("gap_from_ns", "<i8", (s,)), ("gap_to_ns", "<i8", (s,)),
        ("gaps", "<i8", (s,)), ("late_gaps", "<i8", (s,)), ("late_share", "<f8", (s,)), ("late_excess_ns", "<f8", (s,)),
        ("live", "<i8", (s,)),
        ("reaction", reaction_dtype(sensors=s, payload=m)), ("monitor", shape.monitor),
        *([("noise", noise_dtype(shape.adapt, sensors=s, payload=m))] if shape.adapt else []),
    )  # fmt: skip


def desk_dtype(shape: Shape) -> np.dtype[Any]:
    """What must not be rolled back: clocks of arrival, the ring's marks, and the controller.

    ring_first: absolute number of the oldest reading in the ring; ring_count: readings in it.
    newest_*: newest accepted reading.  lateness_ns: by how much a sensor's readings lately came behind the newest of
    all.  odd_*: run of readings that disagree with that clock, from odd_start_ns on.
    applied: the newest acknowledgement.   command*: the last command, when it was given, when the next is due, and
    periods of the grid since; sent: the one before.   wanted, done: the last command before its limits, and what became
    of it.   queue: commands that have not acted yet, oldest first; acting: the one that acts now.   memory: the law's
    own.   source, bump: what the estimate is made of, and what is faded since that last changed.   safe_*: since when
    the command is the safe one (0: it is not), and the last before.   doubt_since_ns: since when no sound sensor
    corrects the state (0: one does).   cost*: mean cost of the commands so far.
    retry_ns, refine_ns: when excluded inputs are looked at again, and open kinds.
    case_at, case_ns: entries of the window, and stamp, at which the last case was opened; case_at 0: none is open.
    nothing_at: entries of the window in which isolation last found nothing.
    calm_until, calm_for: entry of the window until which, and entries for which, too little scatter raises no alarm.
    garbage: unusable readings of each sensor, counted with decay.
    evidence: about the kind of each sensor's fault (faults.hearing), where faults are sought.
    seq_top, seq_seen: highest sequence number of each sensor and which of the 64 up to it came (bit 0: the highest).
    """
    k, s, queue = shape.controls, shape.sensors, shape.queue
    return record(
        ("ring_first", "<i8"), ("ring_count", "<i8"), ("newest_t_ns", "<i8"), ("newest_arrival_ns", "<i8"),
        ("has_arrival", "<i8"), ("started", "<i8"), ("odd_count", "<i8"), ("odd_t_ns", "<i8"),
        ("odd_start_ns", "<i8"), ("lateness_ns", "<i8", (s,)), ("pause", "<i8"), ("replay_from", "<i8"),
        ("review_at", "<i8"), ("case_at", "<i8"), ("case_ns", "<i8"),
        ("retry_ns", "<i8"), ("refine_ns", "<i8"), ("calm_until", "<i8"), ("calm_for", "<i8"),
        ("nothing_at", "<i8"),
        ("seq_top", "<u8", (s,)), ("seq_seen", "<u8", (s,)), ("seq_any", "<i8", (s,)),
        ("reference_t_ns", "<i8"), ("reference", "<f8", (shape.references,)), ("has_reference", "<i8"),
        ("applied_t_ns", "<i8"), ("applied", "<f8", (k,)), ("has_applied", "<i8"),
        ("command", "<f8", (k,)), ("command_due_ns", "<i8"), ("command_started", "<i8"), ("command_t_ns", "<i8"),
        ("command_given", "<i8"), ("command_periods", "<i8"), ("sent", "<f8", (k,)), ("wanted", "<f8", (k,)),
        ("done", "<f8", (k,)), ("queue", "<f8", (queue, k)), ("acting", "<f8", (k,)),
        ("memory", "<f8", (shape.memory,)),
        ("garbage", "<f8", (s,)),
        ("source", "<i8"), ("bump", "<f8", (k,)), ("bump_ns", "<i8"), ("safe_since_ns", "<i8"),
        ("safe_from", "<f8", (k,)), ("doubt_since_ns", "<i8"), ("cost", "<f8"), ("cost_count", "<i8"),
        *([("evidence", evidence_dtype(errors=shape.errors, payload=shape.payload), (s,))] if shape.cells else []),
    )  # fmt: skip


def design_dtype(shape: Shape) -> np.dtype[Any]:
    """The tables made at design time and read at run time; never written by the step.

    x0, U0, d0: initial state.  p: model parameters.  Per sensor: role, length (numbers it sends), dof (channels
    measured), lower/upper (allowed range), R_U, R_d (its R as U diag(d) U'), at (state slots it reads), sp (its
    parameters), wraps (channels that are angles, rad), drives (inputs it sets, -1 none), hold, holds_value, delay_ns
    (its stamps are this much later than what it measured), silence_ns (longest healthy silence, 0 never silent),
    promised_gaps (readings among which one may come later than what was learnt; 0: nothing is learnt).
    heard: (s, f) whether filter f hears sensor s; alone: (f,) whether it hears no other; spares: (f,) whether it leaves
    one out.   protected: (q,) error slots with a protection level; quantile: of it, in deviations.   angle: (states,)
    whether a state is an angle, rad.   without_var: (s, m) variances of an input while its sensor is silent or
    excluded, 0 where the last value holds on.   tests: faults.records.
    free: (s,) whether turning the world about the vertical leaves all readings of a sensor as they are.   heading: slot
    of that angle.   turns_to, turns_by: (n,) where a slot's part goes when the world turns by a right angle, and its
    sign; -1: it stays.   guarded: (g,) slots.   covariance_ns: longest that a covariance lags behind its mean.
    step_ns: fixed step of a discrete model, 0 none.  max_step_ns: longest single prediction, 0 unlimited.
    quiet_ns: how long nothing sound must have come before a run of odd stamps can be the new time base.
    Of the command: c, law_at (the law's parameters, the states it reads), lowest, highest, slew (limits; change per s),
    fade_ns, safe_mode, safe_command, safe_ramp_ns, reckoning_ns, doubt_ns (longest dead reckoning, longest without a
    sound sensor), largest_std (n,), awaited (s,), command_wait_ns (whom a due command waits for, and how long),
    cost_share (of the newest cost in the mean), queue (commands that wait), feeds (the sensor whose reading a command
    is), acknowledged_ns (how long an acknowledgement stands for the next).
    stands_for: the input that the command replaces while it is out, as gain times command, plus offset, plus a state.
    noise: adapt.records, where noise is estimated.
    """
    n, s, m, k = shape.errors, shape.sensors, shape.payload, shape.controls
    return record(
        ("x0", "<f8", (shape.states,)), ("U0", "<f8", (n, n)), ("d0", "<f8", (n,)),
        ("p", "<f8", (shape.model_parameters,)), ("angle", "<i4", (shape.states,)),
        ("role", "<i4", (s,)), ("length", "<i4", (s,)), ("dof", "<i4", (s,)),
        ("lower", "<f8", (s, m)), ("upper", "<f8", (s, m)),
        ("R_U", "<f8", (s, m, m)), ("R_d", "<f8", (s, m)), ("R", "<f8", (s, m)),
        ("at", "<i8", (s, shape.slots)), ("sp", "<f8", (s, shape.sensor_parameters)),
        ("wraps", "<i4", (s, m)), ("drives", "<i4", (s, m)), ("hold", "<i4", (s,)), ("holds_value", "<i4", (s,)),
        ("heard", "<i4", (s, shape.filters)), ("alone", "<i4", (shape.filters,)), ("without_var", "<f8", (s, m)),
        ("spares", "<i4", (shape.filters,)), ("protected", "<i8", (shape.protected,)), ("quantile", "<f8"),
        ("tests", tests_dtype(sensors=s, cells=shape.cells)),
        ("delay_ns", "<i8", (s,)), ("silence_ns", "<i8", (s,)), ("promised_gaps", "<f8", (s,)),
        ("free", "<i4", (s,)), ("heading", "<i8"), ("turns_to", "<i8", (n,)), ("turns_by", "<f8", (n,)),
        ("guarded", "<i8", (shape.guarded,)), ("covariance_ns", "<i8"),
        ("step_ns", "<i8"), ("max_step_ns", "<i8"), ("horizon_ns", "<i8"), ("ahead_ns", "<i8"), ("resync", "<i8"),
        ("quiet_ns", "<i8"),
        ("dead_reckoning_ns", "<i8"), ("invalid_ns", "<i8"),
        ("control_period_ns", "<i8"), ("c", "<f8", (shape.law_parameters,)), ("law_at", "<i8", (shape.slots,)),
        ("lowest", "<f8", (k,)), ("highest", "<f8", (k,)), ("slew", "<f8", (k,)), ("fade_ns", "<i8"),
        ("safe_mode", "<i8"), ("safe_command", "<f8", (k,)), ("safe_ramp_ns", "<i8"), ("reckoning_ns", "<i8"),
        ("doubt_ns", "<i8"),
        ("largest_std", "<f8", (n,)), ("awaited", "<i4", (s,)), ("command_wait_ns", "<i8"), ("cost_share", "<f8"),
        ("feeds", "<i8"), ("acknowledged_ns", "<i8"), ("queue", "<i8"),
        ("stands_for", "<i8"), ("stand_gain", "<f8", (k,)), ("stand_offset", "<f8"), ("stand_plus", "<i8"),
        *([("noise", noise_design_dtype(shape.adapt, sensors=s, payload=m))] if shape.adapt else []),
    )  # fmt: skip


def work_dtype(shape: Shape) -> np.dtype[Any]:
    """Scratch of the step: nothing in it outlives a call but the discretisation of the last intervals, and the window.

    window: what the last readings of updating sensors were to the primary filter; entry k stands at k % shape.window.
    cache_*: F, B, c, G, q of a linear model by interval, so that a regular stream is discretised once.
    """
    n, m, ni, q = shape.errors, shape.payload, shape.inputs, shape.noises
    z = shape.lazy
    return record(
        ("x", "<f8", (shape.states,)), ("F", "<f8", (n, n)), ("B", "<f8", (n, ni)), ("c", "<f8", (n,)),
        ("G", "<f8", (n, q)), ("q", "<f8", (q,)), ("W", "<f8", (n + q + ni, n)), ("w_d", "<f8", (n + q + ni,)),
        ("h", "<f8", (m,)), ("H", "<f8", (m, n)), ("nu", "<f8", (m,)), ("R_U", "<f8", (m, m)), ("R_d", "<f8", (m,)),
        ("R", "<f8", (m, m)), ("root", "<f8", (m,)), ("own", "<f8", (m,)),
        ("K", "<f8", (m, n)), ("D", "<f8", (m, m)), ("hdot", "<f8", (m,)),
        ("tested", "<f8", (m,)), ("carried", "<f8", (n, n + ni)), ("phi", "<f8", (n, shape.cells)),
        ("rho", "<f8", (shape.cells,)), ("gain", "<f8", (shape.cells,)), ("kept_x", "<f8", (shape.states,)),
        ("kept_d", "<f8", (n,)), ("kept_U", "<f8", (n, n)), ("spare", reading_dtype(m), (1,)),
        ("window", window_dtype(n, m, ni), (shape.window,)),
        ("a", "<f8", (n,)), ("b", "<f8", (n,)), ("e", "<f8", (m,)), ("dx", "<f8", (n,)), ("J", "<f8", (n, n)),
        ("through", "<f8", (shape.guarded,)), ("withheld", "<f8", (n,)), ("learned", "<f8", (shape.guarded,)),
        ("learned_ns", "<i8"),
        ("T", "<f8", (z * n, z * n)), ("T2", "<f8", (z * n, z * n)), ("T_d", "<f8", (z * n,)),
        ("settle_W", "<f8", (z * 2 * n, z * n)), ("settle_d", "<f8", (z * 2 * n,)), ("kept_pending", "<i8"),
        ("kept_F", "<f8", (z * n, z * n)), ("kept_Q", "<f8", (z * n, z * n)),
        ("cache_dt_ns", "<i8", (CACHE,)), ("cache_F", "<f8", (CACHE, n, n)), ("cache_B", "<f8", (CACHE, n, ni)),
        ("cache_c", "<f8", (CACHE, n)),
        ("cache_G", "<f8", (CACHE, n, q)), ("cache_q", "<f8", (CACHE, q)),
        *([("noise", noise_work_dtype(shape.adapt, errors=n, payload=m))] if shape.adapt else []),
    )  # fmt: skip


CACHE = 8
"""Intervals whose discretisation a linear model remembers."""
