"""Response: what a unit error of one reading, or of an input over one interval, does to every later innovation.

An error f of raw channel k in one reading and the error eps it has caused in the estimate so far reach the scalar
innovations of the sequential update, c = 1, 2, ..., as

    rho_c = D[c, k] f - H_c eps,     w_c = rho_c / root_c,     eps <- eps + K_c rho_c,

and the next entry through eps <- T eps (+ B g for an input that is wrong by g meanwhile). The running filter is linear
in eps, so every fault is a sum of such impulses: one matrix of their responses serves every hypothesis and every onset.

A window is long enough for its slowest sensor, and then holds many readings of a fast one. Its older readings share
columns (`fold`): an error that lasts is the same in neighbouring readings, so its exact onset alone is lost.

Source: Willsky & Jones 1976 (signatures by recursion); the filter's own gains, so exact in transients.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.numerics.ud import Matrix, Vector

Integers = NDArray[np.int64]
FINE, COARSE = 64, 64
"""Newest readings of a sensor that have columns of their own, and folds of the older ones, where there are more."""


@dataclass(frozen=True, slots=True)
class Steps:
    """Each entry of a window as one linear step of the error of the estimate, errors of its reading beside it.

    With eps before the interval, f the error of the reading (raw channels), g that of the inputs over the interval:
    w = from_error eps + from_reading f + from_input g,   eps <- error eps + reading f + input g.

    Args:
        from_error: (W, m, n).   from_reading: (W, m, m).   from_input: (W, m, k).   error: (W, n, n).
        reading: (W, n, m).   input: (W, n, k).   Rows beyond an entry's dof are zero.
        seen, seen_input: (W, m, n), (W, m, k) what the predicted raw reading moves by for a unit of eps and of g.
    """

    from_error: Matrix
    from_reading: Matrix
    from_input: Matrix
    error: Matrix
    reading: Matrix
    input: Matrix
    seen: Matrix
    seen_input: Matrix


@dataclass(frozen=True, slots=True)
class Response:
    """A window seen as rows (scalar innovations) and columns (impulses), both oldest first.

    Args:
        t_ns: (W,) stamps.   t_s: the same in seconds since the first.   sensor, dof: (W,).
        entry: (E,) entry of each row.   e: (E,) whitened innovations.
        noise: (W, m, m) a square root of the covariance of each reading's own noise, raw channels.
        impulses: (E, J).   matched: (J,) their products with e.
        carried: (n, J) error of the estimate each impulse has caused by the window's end.
        raw: (W, m) column of an error of each raw channel;   held: (W, k) of each input; -1: none.
        begins, begins_input: (W,) entry that begins the fold an entry is in, of its sensor and of the inputs.
        h, hdot: (W, m) predicted raw reading and its rate, 1/s.   steps: as above.
        odd: (W, k) largest square of each input's deviations since the entry before;   odd_count: how many were odd;
            away: the mean of these deviations, in its unit.
        filtered: (E, E) what e and impulses have been through since (`tolerate`); None: nothing.
    """

    t_ns: Integers
    t_s: Vector
    sensor: Integers
    dof: Integers
    entry: Integers
    e: Vector
    noise: Matrix
    impulses: Matrix
    matched: Vector
    carried: Matrix
    raw: Integers
    held: Integers
    begins: Integers
    begins_input: Integers
    h: Matrix
    hdot: Matrix
    steps: Steps
    odd: Matrix
    odd_count: Integers
    away: Matrix
    filtered: Matrix | None = None

    def __len__(self) -> int:
        """Entries of the window."""
        return len(self.t_ns)


def steps_of(window: NDArray[Any]) -> Steps:
    """Fold each entry's sequential scalar updates, and the interval before them, into one step."""
    W, m, n = window["H"].shape
    exists = np.arange(m) < window["dof"][:, None]
    H = window["H"] * exists[:, :, None]
    K = window["K"] * (exists & (window["used"] != 0)[:, None])[:, :, None]
    D = window["D"] * (exists[:, :, None] & exists[:, None, :])
    root = np.where(exists & (window["root"] > 0.0), window["root"], np.inf)
    kept: Matrix = np.broadcast_to(np.eye(n), (W, n, n)).copy()
    reading: Matrix = np.zeros((W, n, m))
    rho_error: Matrix = np.zeros((W, m, n))
    rho_reading: Matrix = np.zeros((W, m, m))
    for c in range(m):
        rho_error[:, c] = -np.einsum("wi,wij->wj", H[:, c], kept)
        rho_reading[:, c] = D[:, c] - np.einsum("wi,wij->wj", H[:, c], reading)
        kept += K[:, c, :, None] * rho_error[:, c, None, :]
        reading += K[:, c, :, None] * rho_reading[:, c, None, :]
    rho_error /= root[:, :, None]
    rho_reading /= root[:, :, None]
    T, B = window["T"], window["B"]
    raw = undecorrelated(window) @ H
    return Steps(rho_error @ T, rho_reading, rho_error @ B, kept @ T, reading, kept @ B, raw @ T, raw @ B)


def undecorrelated(window: NDArray[Any]) -> Matrix:
    """(W, m, m) from decorrelated to raw channels: D^-1, the identity beyond an entry's dof."""
    m = window["e"].shape[1]
    exists = np.arange(m) < window["dof"][:, None]
    return np.linalg.inv(np.where(exists[:, :, None] & exists[:, None, :], window["D"], np.eye(m)))


def noise_roots(window: NDArray[Any]) -> Matrix:
    """(W, m, m) a square root of the covariance of each reading's own noise, in raw channels: D^-1 diag(sqrt(r)).

    The variance r of each scalar's own noise is S (1 - H K), as K = P H'/S; where a reading was not used, K is unknown
    and the median of its sensor's others stands in, and S where there are none. Where noise is estimated the gain knows
    another R than S does, and the entry has r itself.
    """
    m = window["e"].shape[1]
    S = window["root"] ** 2
    share = 1.0 - np.einsum("wci,wci->wc", window["H"], window["K"])
    r, used = S * np.clip(share, 1e-12, 1.0), window["used"] != 0
    for sensor in np.unique(window["sensor"][~used]):
        own = window["sensor"] == sensor
        if np.any(own & used):
            r[own & ~used] = np.minimum(np.median(r[own & used], axis=0), S[own & ~used])
    r = np.where(window["own"] > 0.0, window["own"], r)
    exists = np.arange(m) < window["dof"][:, None]
    return undecorrelated(window) * np.sqrt(np.where(exists, r, 0.0))[:, None, :]


def fold(sensor: Integers) -> Integers:
    """(W,) entry that begins the fold of each: the newest FINE of a sensor each alone, older ones in COARSE folds.

    A sensor with no more than FINE + COARSE entries has none folded.
    """
    begins = np.arange(len(sensor))
    for one in np.unique(sensor):
        own = np.flatnonzero(sensor == one)
        if len(own) <= FINE + COARSE:
            continue
        for together in np.array_split(own[:-FINE], COARSE):
            begins[together] = together[0]
    return begins


@dataclass(frozen=True, slots=True)
class _Columns:
    """Column of every impulse (see `Response`), their number, and how many there are before each entry."""

    raw: Integers
    held: Integers
    count: int
    before: Integers


def _columns(dof: Integers, begins: Integers, begins_input: Integers, m: int, inputs: int) -> _Columns:
    """Number the columns in the order in which they begin: of one entry its inputs, then its channels."""
    entries = np.arange(len(dof))
    new_inputs, new = np.where(begins_input == entries, inputs, 0), np.where(begins == entries, dof, 0)
    before = np.concatenate(([0], np.cumsum(new_inputs + new)))
    channel = np.arange(m)
    first = before[:-1] + new_inputs
    raw = np.where(channel < dof[:, None], first[begins][:, None] + channel, -1)
    return _Columns(raw, before[:-1][begins_input][:, None] + np.arange(inputs), int(before[-1]), before[:-1])


def _impulses(steps: Steps, dof: Integers, columns: _Columns) -> tuple[Matrix, Matrix]:
    """(E, J) responses, and (n, J) errors they leave."""
    inputs = columns.held.shape[1]
    row = np.concatenate(([0], np.cumsum(dof)))
    X: Matrix = np.zeros((row[-1], columns.count))
    phi: Matrix = np.zeros((steps.error.shape[1], columns.count))
    for k in range(len(dof)):
        d, known = dof[k], columns.before[k]
        rows, raw, held = X[row[k] : row[k + 1]], columns.raw[k, :d], columns.held[k]
        np.matmul(steps.from_error[k, :d], phi[:, :known], out=rows[:, :known])
        phi[:, :known] = steps.error[k] @ phi[:, :known]
        rows[:, raw] += steps.from_reading[k, :d, :d]
        phi[:, raw] += steps.reading[k, :, :d]
        if inputs:
            rows[:, held] += steps.from_input[k, :d, :inputs]
            phi[:, held] += steps.input[k, :, :inputs]
    return X, phi


def respond(window: NDArray[Any], inputs: int = 0) -> Response:
    """Follow a unit error of every reading, and of every input over every interval, through a window.

    Args:
        window: (W,) entries of `window_dtype`, oldest first.   inputs: how many inputs may be wrong, numbered from 0.
    """
    steps = steps_of(window)
    dof = window["dof"].astype(np.int64)
    m = window["e"].shape[1]
    sensor = window["sensor"].astype(np.int64)
    begins, begins_input = fold(sensor), fold(np.zeros(len(dof), dtype=np.int64))
    columns = _columns(dof, begins, begins_input, m, inputs)
    X, phi = _impulses(steps, dof, columns)
    t_ns, e = window["t_ns"].astype(np.int64), window["e"][np.arange(m) < dof[:, None]]
    return Response(
        t_ns, (t_ns - t_ns[0]) * 1e-9, sensor, dof, np.repeat(np.arange(len(dof)), dof), e, noise_roots(window),
        X, X.T @ e, phi, columns.raw, columns.held, begins, begins_input, window["h"], window["hdot"], steps,
        window["odd"], window["odd_count"], window["away"],
    )  # fmt: skip
