"""The healthy course of a configuration: its sensors at their rates, its filter settled, every model linearised.

Sensors are taken to read at their `rate_hz`, the slowest one's period divided evenly by the others; one without a rate
is taken to be as slow as the slowest that has one. Where a sensor reads more than MOST times in that period, several of
its readings are taken as one of less noise. A model that is not linear is linearised along a trial motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fusiond.assembly.initial import initial_covariance
from fusiond.assembly.observability import trial_interval_s
from fusiond.assembly.resolve import Resolved, ResolvedSensor
from fusiond.assembly.trial import Array, Trial, irregular
from fusiond.faults.course import Course
from fusiond.numerics.kernel import interpreted
from fusiond.numerics.ud import ud_factor

MOST = 48
"""Readings of one sensor in one period of the slowest; faster ones are taken together."""
ALONG = 64
"""Readings along the trial motion of a model that is not linear, at least."""
DOUBLINGS = 10
"""The filter has settled for two to the power of this many periods."""
WITNESS = -1
"""Number of a sensor that the configuration does not have."""
SMALLEST_NOISE = 1e-12
"""A noise variance below this share of the reading's predicted variance is taken for it: a perfect reading informs
without limit."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One reading of the schedule: sensor, its time, and how many readings it stands for."""

    sensor: int
    t_s: float
    readings: int


@dataclass(frozen=True, slots=True)
class Witness:
    """A sensor that is not there: it reads one error state, once in the slowest sensor's period."""

    state: int
    noise_std: float


def slowest_period_s(resolved: Resolved) -> float:
    """Longest period among the updating sensors whose rate is known."""
    rates = [s.section.rate_hz for s in resolved.updating if s.section and s.section.rate_hz]
    return max(1.0 / min(rates) if rates else trial_interval_s(resolved), resolved.process.step_s)


def rate_hz(resolved: Resolved, sensor: ResolvedSensor) -> float:
    """Readings a second of one sensor, input or updating."""
    known = sensor.section.rate_hz if sensor.section else None
    return known or 1.0 / slowest_period_s(resolved)


def schedule(resolved: Resolved) -> tuple[list[Entry], float]:
    """One period of the slowest sensor: its entries in order, and how long it is, s."""
    period_s = slowest_period_s(resolved)
    entries = []
    for number, sensor in enumerate(resolved.sensors):
        if sensor not in resolved.updating:
            continue
        count = max(1, round(rate_hz(resolved, sensor) * period_s))
        together = -(-count // MOST)
        places = count // together
        entries += [Entry(number, place * period_s / places, together) for place in range(places)]
    entries.sort(key=lambda entry: (round(entry.t_s, 9), entry.sensor))
    return entries, period_s


@dataclass(slots=True)
class _Interval:
    """From one entry to the next: transition, response to the inputs, noise."""

    T: Array
    B: Array
    Q: Array


def _noise(resolved: Resolved, x: Array, dt_s: float) -> Array:
    """(n, n) process noise of one interval, without that of the inputs."""
    process, module = resolved.process, resolved.process_module
    n, k, m = len(process.error_slots), max(process.noises, 1), max(len(process.inputs), 1)
    p = np.array(process.parameters or (0.0,), dtype=np.float64)
    G, q = np.zeros((n, k)), np.zeros(k)
    if process.linear:
        interpreted(module.discretise)(dt_s, p, np.zeros((n, n)), np.zeros((n, m)), np.zeros(n), G, q)
    else:
        interpreted(module.noise)(x, dt_s, p, G, q)
    return np.asarray((G * q) @ G.T)


def _held_variances(resolved: Resolved) -> Array:
    """Noise variance of each process input."""
    held = np.zeros(len(resolved.process.inputs))
    for sensor in resolved.sensors:
        held[list(sensor.drives)] = np.diagonal(sensor.R)[: len(sensor.drives)]
    return held


def _through(resolved: Resolved, trial: Trial, x: Array, u: Array, dt_s: float) -> tuple[Array, _Interval]:
    """Move x over dt_s in the pieces the step would take, and gather the interval."""
    n, k = len(resolved.process.error_slots), len(resolved.process.inputs)
    gathered = _Interval(np.eye(n), np.zeros((n, k)), np.zeros((n, n)))
    process, held = resolved.process, _held_variances(resolved)
    pieces = 1 if process.max_step_s <= 0.0 else int(np.ceil(dt_s / process.max_step_s - 1e-9))
    piece_s = dt_s / max(pieces, 1)
    if process.step_s > 0.0:
        pieces, piece_s = round(dt_s / process.step_s), process.step_s
    if dt_s <= 0.0:
        pieces = 0
    for _ in range(pieces):
        noise = _noise(resolved, x, piece_s)
        x, F, B = trial.move(x, u, piece_s)
        noise = noise + (B * held) @ B.T
        gathered.T = F @ gathered.T
        gathered.B = F @ gathered.B + B
        gathered.Q = F @ gathered.Q @ F.T + noise
    return x, gathered


def _whitened(R: Array, H: Array) -> tuple[Array, Array, Array]:
    """Decorrelated rows U^-1 H, their noise variances, and U^-1, with R = U diag(d) U'."""
    U, d = np.eye(len(R)), np.zeros(len(R))
    interpreted(ud_factor)(R.copy(), U, d, 1e-9)
    D = np.asarray(np.linalg.inv(np.triu(U)), dtype=np.float64)
    return D @ H, d, D


@dataclass(slots=True)
class _Path:
    """A trial motion through one period: per entry the interval before it and the look at its end."""

    intervals: list[_Interval]
    looks: list[tuple[Array, Array, Array]]
    h: list[Array]
    hdot: list[Array]


def _look(
    resolved: Resolved, trial: Trial, x: Array, turn: int, entry: Entry, witness: Witness | None
) -> tuple[Array, Array, Array]:
    """h, H and R of one entry."""
    if entry.sensor == WITNESS and witness is not None:
        H = np.zeros((1, len(resolved.process.error_slots)))
        H[0, witness.state] = 1.0
        return np.zeros(1), H, np.full((1, 1), witness.noise_std**2)
    sensor = resolved.sensors[entry.sensor]
    h, H = trial.look(sensor, x, turn)
    return h, H, sensor.R / entry.readings


def _path(
    resolved: Resolved, entries: list[Entry], period_s: float, x: Array, witness: Witness | None
) -> _Path:
    """Walk the trial motion. Its first interval leads from the last entry of the period before."""
    trial = Trial(resolved)
    path = _Path([], [], [], [])
    known: dict[float, _Interval] = {}
    before_s = entries[-1].t_s - period_s
    rate = np.zeros(len(resolved.process.error_slots))
    for turn, entry in enumerate(entries):
        dt_s = round(entry.t_s - before_s, 9)
        u = 2.0 * (irregular(len(resolved.process.inputs), turn) - 1.0)
        start = x
        if resolved.process.linear and dt_s in known:
            interval = known[dt_s]
        else:
            x, interval = _through(resolved, trial, x, u, dt_s)
            known[dt_s] = interval
        if resolved.process.linear:
            x = interval.T @ start + interval.B @ u
        if dt_s > 0.0:
            rate = trial.error(start, x) / dt_s
        h, H, R = _look(resolved, trial, x, turn, entry, witness)
        path.intervals.append(interval)
        path.looks.append(_whitened(R, H))
        path.h.append(h)
        path.hdot.append(H @ rate)
        if not resolved.process.linear and dt_s > 0.0:
            x = trial.shift(x, 0.3 * (irregular(len(rate), turn) - 1.0))
        before_s = entry.t_s
    return path


def _settled_covariance(path: _Path, P: Array) -> Array:
    """Covariance after the last entry, the period repeated two to the power of DOUBLINGS times.

    One period maps P to C + A P (I + G P)^-1 A', and so do two (structure-preserving doubling).
    Source: Anderson 1978, "Second-order convergent algorithms for the steady-state Riccati equation".
    """
    n = len(P)
    eye = np.eye(n)
    A, G, C = eye, np.zeros((n, n)), np.zeros((n, n))
    for interval, (H, r, _) in zip(path.intervals, path.looks, strict=True):
        A, C = interval.T @ A, interval.T @ C @ interval.T.T + interval.Q
        spread = np.einsum("ci,ij,cj->c", H, C, H) + 1e-30
        information = (H.T / np.maximum(r, SMALLEST_NOISE * spread)) @ H
        W = np.linalg.solve(eye + C @ information, eye)
        G = G + A.T @ information @ W @ A
        A, C = W @ A, W @ C
        C, G = 0.5 * (C + C.T), 0.5 * (G + G.T)
    for _ in range(DOUBLINGS):
        W = np.linalg.solve(eye + C @ G, eye)
        A, G, C = A @ W @ A, G + A.T @ G @ W @ A, C + A @ W @ C @ A.T
        C, G = 0.5 * (C + C.T), 0.5 * (G + G.T)
    settled = C + A @ P @ np.linalg.solve(eye + G @ P, A.T)
    return 0.5 * (settled + settled.T)


def _entries(resolved: Resolved, witness: Witness | None) -> tuple[list[Entry], float]:
    """The entries of one period of the course, and how long it is, s."""
    entries, period_s = schedule(resolved)
    if witness is not None:
        entries = [Entry(WITNESS, 0.0, 1), *entries]
    if resolved.process.linear:
        return entries, period_s
    times = -(-ALONG // len(entries))
    along = [
        Entry(entry.sensor, entry.t_s + turn * period_s, entry.readings)
        for turn in range(times)
        for entry in entries
    ]
    return along, period_s * times


def witness_of(resolved: Resolved, state: int) -> Witness:
    """A witness that knows an error state as well as the settled filter does."""
    entries, period_s = _entries(resolved, None)
    path = _path(resolved, entries, period_s, Trial(resolved).start(), None)
    P = _settled_covariance(path, initial_covariance(resolved))
    return Witness(state, float(np.sqrt(max(P[state, state], 1e-300))))


def course_of(resolved: Resolved, witness: Witness | None = None) -> Course:
    """The healthy course of a configuration, with a witness beside its sensors or without."""
    entries, period_s = _entries(resolved, witness)
    path = _path(resolved, entries, period_s, Trial(resolved).start(), witness)
    P = _settled_covariance(path, initial_covariance(resolved))
    W, n, k = len(entries), len(P), len(resolved.process.inputs)
    m = max(sensor.model.dof for sensor in resolved.updating)
    dof = np.array([len(r) for _, r, _ in path.looks])
    course = Course(
        np.array([entry.t_s for entry in entries]), period_s, np.array([entry.sensor for entry in entries]), dof,
        np.zeros((W, m, n)), np.zeros((W, m, n)), np.zeros((W, m)), np.zeros((W, m, m)),
        np.array([interval.T for interval in path.intervals]),
        np.array([interval.B for interval in path.intervals]).reshape(W, n, k),
        np.zeros((W, m)), np.zeros((W, m)), not resolved.process.linear or k > 0,
    )  # fmt: skip
    for place in range(W):
        P = _fill(course, path, place, P)
    return course


def _fill(course: Course, path: _Path, place: int, P: Array) -> Array:
    """Write one entry of the course and return the covariance after it."""
    interval, (H, r, D) = path.intervals[place], path.looks[place]
    dof = len(r)
    P = interval.T @ P @ interval.T.T + interval.Q
    for c in range(dof):
        S = H[c] @ P @ H[c] + r[c]
        gain = P @ H[c] / S if S > 0.0 else np.zeros(len(P))
        P = P - np.outer(gain, gain) * S
        course.root[place, c], course.H[place, c], course.K[place, c] = np.sqrt(max(S, 0.0)), H[c], gain
        course.D[place, c, :dof] = D[c]
    course.h[place, :dof], course.hdot[place, :dof] = path.h[place], path.hdot[place]
    return 0.5 * (P + P.T)
