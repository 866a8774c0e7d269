"""Evidence about the kind of a sensor's fault, gathered reading by reading for as long as the fault lasts.

A sensor that is excluded is still looked at, and what the filter knows without it tells what it should have read. But
those innovations are not white: all of them hold one error of that filter, which its own readings alone take away. So
the window is heard once more as a filter would that uses the sensor. Where the filter has P and that one P - G,

    G <- T G T',    S <- S - H G H',    g = P H',  g_heard = g - G H',
    G <- G - g g'/S + g_heard g_heard'/S_heard        (only the last term where the sensor is looked at alone),

and its estimate is x + shift. P itself is not needed: each entry has its P H' in its gain. Of a sensor that is used,
with or without its error taken off, G stays zero and the innovations are those of the filter.

Beside them go the errors that a unit of each possible fault has caused since the onset: a column for every channel and
kind. Their whitened means w and the innovations e leave sum w w' and sum w e, from which every hypothesis of
`hypotheses` follows. Nothing is forgotten when entries leave the window.

Source: a Kalman filter, written as a difference to another one; Friedland 1969 for the columns.
Law: tests/laws/test_hearing.py::test_what_is_heard_again_is_what_a_filter_with_the_sensor_would_have_seen.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fusiond.faults.window import LOOKED
from fusiond.numerics.packed import packed
from fusiond.numerics.ud import Matrix, Vector
from fusiond.types import Kind

KINDS = (Kind.BIAS, Kind.DRIFT, Kind.SCALE, Kind.DELAY)
"""Lasting errors, in the order of their columns: one of each channel for every kind."""
LEAST_SHARE = 1e-9
"""No innovation is surer than this share of its variance without the sensor: one that is shows that the filter's own
covariance was changed between its readings (scaled, widened), and then nothing that was heard holds."""
LARGEST = 1e100
"""Nor is any error that a unit of a fault causes larger, of a filter that still follows its sensors."""


def evidence_dtype(*, errors: int, payload: int) -> np.dtype[Any]:
    """Of one sensor; n errors, m channels, q = 4 m columns by kind, then channel. All zero: nothing heard.

    from_ns: stamp of the onset;   heard_ns: of the last entry heard.   readings: of the sensor.   score: of the best
    explanation so far (`refining`); it falls when the fault has ended.
    gap: G;   shift;   moved: (n, q) errors of the estimate for a unit of each column;   information, matched: sums of
    w w' and w e;   power: sums of the squared error of a reading for a unit of each column, in deviations of its noise.
    """
    n, m = errors, payload
    q = len(KINDS) * m
    return packed([
        ("from_ns", "<i8"), ("heard_ns", "<i8"), ("readings", "<i8"), ("score", "<f8"),
        ("gap", "<f8", (n, n)), ("shift", "<f8", (n,)),
        ("moved", "<f8", (n, q)), ("information", "<f8", (q, q)), ("matched", "<f8", (q,)), ("power", "<f8", (q,)),
    ])  # fmt: skip


def begin(evidence: NDArray[Any], onset_ns: int, surely_ns: int) -> None:
    """Forget what was heard; a fault began at `onset_ns`, and by `surely_ns` at the latest, from which on is heard."""
    evidence[:] = np.zeros(1, evidence.dtype)
    evidence["from_ns"], evidence["heard_ns"] = onset_ns, surely_ns - 1


def hear(evidence: NDArray[Any], window: NDArray[Any], sensor: int, noise_std: Vector, until_ns: int) -> None:
    """Hear the entries since those heard before.

    Args:
        evidence: (1,) of `evidence_dtype`, in place.   window: entries of `window_dtype`, oldest first, looks included.
        noise_std: (m,) declared deviations of the sensor.   until_ns: stamps beyond this are for the next time.
    """
    ear = evidence[0]
    for entry in window[(window["t_ns"] > ear["heard_ns"]) & (window["t_ns"] <= until_ns)]:
        try:
            _hear(ear, entry, sensor, noise_std)
        except Lost:
            begin(evidence, 0, 0)
            return


class Lost(Exception):
    """What was heard holds no longer."""


def _hear(ear: Any, entry: Any, sensor: int, noise_std: Vector) -> None:
    """One entry: the interval before it, then its channels."""
    own = int(entry["sensor"]) == sensor
    if ear["readings"]:
        T = entry["T"]
        ear["gap"], ear["shift"], ear["moved"] = T @ ear["gap"] @ T.T, T @ ear["shift"], T @ ear["moved"]
    ear["heard_ns"] = entry["t_ns"]
    looked = int(entry["used"]) == LOOKED
    if (looked and not own) or not (own or ear["readings"]):
        return
    dof = int(entry["dof"])
    error = np.zeros((dof, ear["moved"].shape[1]))
    if own:
        error = errors_of(
            entry, dof, (int(entry["t_ns"]) - int(ear["from_ns"])) * 1e-9, ear["moved"].shape[1]
        )
        ear["readings"] += 1
        ear["power"] += np.sum((error / noise_std[:dof, np.newaxis]) ** 2, axis=0)
    undone, unshifted = np.zeros_like(ear["gap"]), np.zeros_like(ear["shift"])
    for c in range(dof):
        gain_once, shift_once = _hear_channel(ear, entry, c, entry["D"][c, :dof] @ error)
        undone, unshifted = undone + gain_once, unshifted + shift_once
    if looked:
        ear["gap"] += undone
        ear["shift"] += unshifted


def _hear_channel(ear: Any, entry: Any, c: int, error: Vector) -> tuple[Matrix, Vector]:
    """One scalar innovation; returns what its update took from P, and added to x, in the filter itself."""
    H, S = entry["H"][c], float(entry["root"][c]) ** 2
    if S <= 0.0:
        return np.zeros_like(ear["gap"]), np.zeros_like(ear["shift"])
    S_gain = S
    if entry["own"][c] > 0.0:  # the gain knows another R than the monitors do
        share = float(H @ entry["K"][c])
        S_gain = (S - float(entry["own"][c])) / share if share > 0.0 else S
    nu, g, common = float(entry["e"][c] * entry["root"][c]), entry["K"][c] * S_gain, ear["gap"] @ H
    S_heard = S - float(H @ common)
    if S_heard < LEAST_SHARE * S or not np.all(np.abs(ear["moved"]) < LARGEST):
        raise Lost
    nu_heard = nu - float(H @ ear["shift"])
    rho = error - H @ ear["moved"]
    ear["information"] += np.outer(rho, rho) / S_heard
    ear["matched"] += rho * (nu_heard / S_heard)
    if not entry["used"]:
        return np.zeros_like(ear["gap"]), np.zeros_like(ear["shift"])
    g_heard = g - common
    taken, added = np.outer(g, g) / S_gain, g * (nu / S_gain)
    ear["gap"] += np.outer(g_heard, g_heard) / S_heard - taken
    ear["shift"] += g_heard * (nu_heard / S_heard) - added
    ear["moved"] += np.outer(g_heard / S_heard, rho)
    return taken, added


def errors_of(entry: Any, dof: int, since_s: float, columns: int) -> Matrix:
    """(dof, q) error of each raw channel for a unit of each column: 1, seconds since the onset, h, and -dh/dt."""
    error: Matrix = np.zeros((dof, columns))
    m, channel = columns // len(KINDS), np.arange(dof)
    for place, profile in enumerate((1.0, since_s, entry["h"][:dof], -entry["hdot"][:dof])):
        error[channel, place * m + channel] = profile
    return error
