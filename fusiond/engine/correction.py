"""Errors taken off readings: one put on top of another, and whether that has made the innovations better.

A reading is used as z' = (z - offset - drift t) / (1 + gain_error), measured `lag` before its stamp. An error found in
z' is one of the corrected reading, so with what is taken off already it makes

    bias b: offset + (1 + gain_error) b,   drift likewise,   scale s: (1 + gain_error) (1 + s) - 1,   delay: the sum.

The uncertainty of what is taken off is added to the estimate along the direction in which such an error moves it
(Friedland 1969), and added once more when it ends.

No step is believed for itself. A fit promises that the squares of the innovations since its onset will be fewer; the
readings are replayed with it, and where there are not fewer it is withdrawn: what was wrong was not that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fusiond.faults.glr import Fit
from fusiond.faults.hearing import KINDS
from fusiond.faults.window import believed
from fusiond.types import Kind, Role

if TYPE_CHECKING:
    from fusiond.engine.engine import Engine
    from fusiond.engine.reactions import Reactions

CORRECTIONS = {Kind.BIAS: "offset", Kind.DRIFT: "drift", Kind.SCALE: "gain_error", Kind.DELAY: "lag"}
"""Field of what is taken off, by the kind of the error."""
LASTING = tuple(CORRECTIONS)
"""Errors that can be taken off a reading."""


def put_on(taken: dict[str, Any], kind: Kind, channel: int, size: float) -> None:
    """Add an error found in corrected readings to what is taken off a raw channel.

    Args:
        taken: `offset`, `drift`, `gain_error`, `lag`, (m,) each; changed.   size: as in `Hypothesis`.
    Law: tests/laws/test_correction.py::test_a_second_error_is_taken_off_what_is_left_of_the_first.
    """
    gain = 1.0 + float(taken["gain_error"][channel])
    share = gain if kind in (Kind.BIAS, Kind.DRIFT, Kind.SCALE) else 1.0
    taken[CORRECTIONS[kind]][channel] += share * size


def once_gone(
    window: NDArray[Any], reaction: Any, sensor: int, drives: Sequence[int] = ()
) -> NDArray[np.float64]:
    """(W, m) error of a sensor's corrected readings, raw channels, in each entry if what is taken off had gone by then.

    Args:
        reaction: one record.   drives: process input of each channel, of a sensor that drives: then (W, k) of inputs.
    """
    since_s = ((window["t_ns"] - reaction["from_ns"][sensor, 1]) * 1e-9)[:, None]
    offset, drift, gain_error, lag = (reaction[field][sensor, 1] for field in CORRECTIONS.values())
    m = window["h"].shape[1]
    h, hdot = (np.zeros((len(window), len(offset))) for _ in range(2))
    if not len(drives):
        h[:, :m], hdot[:, :m] = window["h"], window["hdot"]
    left = (h - offset - drift * since_s) / (1.0 + gain_error) - h + hdot * lag
    left = np.where(since_s >= 0.0, left, 0.0)
    if not len(drives):
        return np.asarray(left[:, :m])
    of_inputs = np.zeros((len(window), window["B"].shape[2]))
    of_inputs[:, list(drives)] = left[:, : len(drives)]
    return of_inputs


def add_correction(reactions: Reactions, sensor: int, fit: Fit, kind: Kind) -> None:
    """Take the error found, on top of what is taken off already, off every reading since its onset."""
    if kind not in LASTING:
        return
    onset_ns = max(1, reactions.onset_ns(fit.onset))
    now = _next_correction(reactions, sensor, onset_ns)
    for k, part in enumerate(fit.hypothesis.parts):
        for one in part:
            if one.sensor == sensor:
                channel = reactions.raw_channel(one)
                put_on(now, kind, channel, float(fit.size[k]))
                if kind is Kind.BIAS and not one.is_input:
                    reactions.widen_by(sensor, channel, float(np.sqrt(fit.covariance[k, k])))
    for field, value in now.items():
        _write_correction(reactions, field, value, sensor)
    reactions.since(fit.onset)


def _next_correction(reactions: Reactions, sensor: int, onset_ns: int) -> dict[str, Any]:
    """End the correction now in force at `onset_ns`, and return what goes on from there.

    A correction has two rows in the record: 0 the one before, 1 the one in force.
    """
    was = {
        field: np.array(reactions.reaction[field][sensor])
        for field in ("from_ns", "to_ns", *CORRECTIONS.values())
    }
    now = {field: np.array(was[field][1]) for field in CORRECTIONS.values()}
    if was["from_ns"][1] and not was["to_ns"][1]:
        now["offset"] += now["drift"] * (onset_ns - was["from_ns"][1]) * 1e-9
        was["to_ns"][1] = onset_ns
    else:
        now = {field: np.zeros_like(value) for field, value in now.items()}
    for field, value in was.items():
        for records in reactions.engine.histories:
            records["reaction"][field][:, sensor, 0] = value[1]
    return {**now, "from_ns": onset_ns, "to_ns": 0}


def _write_correction(reactions: Reactions, field: str, value: Any, sensor: int) -> None:
    """Write a field of the correction in force."""
    for records in reactions.engine.histories:
        records["reaction"][field][:, sensor, 1] = value


def taken_off(reactions: Reactions, sensor: int) -> NDArray[np.float64]:
    """(q,) what is taken off the sensor's readings now, in the columns of `faults.hearing`."""
    return np.concatenate([reactions.reaction[CORRECTIONS[kind]][sensor, 1] for kind in KINDS])


def replace_correction(reactions: Reactions, sensor: int, kind: Kind, sizes: Mapping[int, float]) -> None:
    """Take another error off, by raw channel, since the onset of the one taken off till now."""
    for field in CORRECTIONS.values():
        _write_correction(reactions, field, 0.0, sensor)
    value = np.zeros(reactions.layout.shape.payload)
    for channel, size in sizes.items():
        value[channel] = size
    _write_correction(reactions, CORRECTIONS[kind], value, sensor)
    reactions.replay_from(int(reactions.reaction["from_ns"][sensor, 1]))


def lift_correction(reactions: Reactions, sensor: int, onset: int) -> None:
    """Take nothing off the readings of a sensor from an entry on."""
    _next_correction(reactions, sensor, reactions.onset_ns(onset))
    _write_correction(reactions, "from_ns", 0, sensor)


def end_correction(reactions: Reactions, sensor: int, onset: int) -> None:
    """Believe the readings as they are from now on: those since the entry are held against an estimate too sure.

    How unsure the error taken off was is added to the estimate now, so what came meanwhile is left out.
    """
    for channel, std in _doubts(reactions, sensor):
        reactions.widen_by(sensor, channel, std)
    lift_correction(reactions, sensor, onset)
    if reactions.layout.sensors[sensor].role is Role.UPDATE:
        reactions.leave_out_until_now(sensor, reactions.onset_ns(onset))
    reactions.since(onset)


def unsure(reactions: Reactions, sensor: int) -> float:
    """Deviation of the error taken off a sensor, as a share of it."""
    reaction = reactions.reaction
    usual = 1.0 if reaction["kind"][sensor] == Kind.SCALE else 0.0
    size = abs(float(reaction["size"][sensor]) - usual)
    return min(float(reaction["size_std"][sensor]) / size, 1.0) if size > 0.0 else 1.0


def _doubts(reactions: Reactions, sensor: int) -> list[tuple[int, float]]:
    """Of each channel that an error is taken off, how unsure that is by now: as a share, and by its noise."""
    own = np.flatnonzero(reactions.window["sensor"] == sensor)
    if not len(own):
        return []
    left = np.abs(once_gone(reactions.window[own[-1:]], reactions.reaction, sensor)[0])
    main = max(0, int(reactions.reaction["channel"][sensor]))
    noise = reactions.noise_std[sensor]
    by_noise = left[main] * noise / noise[main] if noise[main] > 0.0 else 0.0 * noise
    share = unsure(reactions, sensor)
    return [
        (int(channel), share * float(max(left[channel], by_noise[channel])))
        for channel in np.flatnonzero(left)
    ]


def drop_correction(reactions: Reactions, sensor: int, onset: int) -> None:
    """Believe the readings as they are from an entry on, and let the estimate return to where they are."""
    taken = _next_correction(reactions, sensor, reactions.onset_ns(onset))["offset"]
    _write_correction(reactions, "from_ns", 0, sensor)
    for channel in np.flatnonzero(taken):
        reactions.widen_by(sensor, int(channel), abs(float(taken[channel])))
    reactions.doubt_everything()
    reactions.since(onset)


def left_over(reactions: Reactions, sensor: int, fit: Fit, kind: Kind) -> tuple[float, float]:
    """The error that would remain if the fit's were added to the one taken off, and its deviation.

    A scale is judged as a factor, a delay in s, all else in the channel's unit at the fit's onset.
    """
    at = next(k for k, part in enumerate(fit.hypothesis.parts) if any(one.sensor == sensor for one in part))
    size, variance = float(fit.size[at]), float(fit.covariance[at, at])
    known = float(reactions.reaction["size_std"][sensor])
    channel = max(0, int(reactions.reaction["channel"][sensor]))
    if kind is Kind.SCALE:
        gain = (1.0 + float(reactions.reaction["gain_error"][sensor, 1, channel])) * (1.0 + size) - 1.0
        return gain, float(np.hypot(known, np.sqrt(variance)))
    if kind is Kind.DELAY:
        lag = float(reactions.reaction["lag"][sensor, 1, channel]) + size
        return lag, float(np.hypot(known, np.sqrt(variance)))
    since_s = (reactions.onset_ns(fit.onset) - int(reactions.reaction["from_ns"][sensor, 1])) * 1e-9
    taken = float(reactions.reaction["offset"][sensor, 1, channel])
    taken += float(reactions.reaction["drift"][sensor, 1, channel]) * since_s
    if reactions.reaction["kind"][sensor] == Kind.DRIFT:
        known *= since_s
    gain = 1.0 + float(reactions.reaction["gain_error"][sensor, 1, channel])
    left = taken + (gain * size if kind is Kind.BIAS else 0.0)
    return left, float(np.hypot(known, gain * np.sqrt(variance)))


def total_taken_off(reactions: Reactions, sensor: int, kind: Kind) -> float:
    """All that is taken off the sensor's readings now, of one kind: its size as it is told."""
    channel = max(0, int(reactions.reaction["channel"][sensor]))
    taken = float(reactions.reaction[CORRECTIONS[kind]][sensor, 1, channel])
    return 1.0 + taken if kind is Kind.SCALE else taken


def misfit(engine: Engine, since_ns: int) -> float:
    """Sum of the squares of the window's innovations since a time; infinite where they are no numbers."""
    window, _ = believed(engine.window)
    late = window["t_ns"] >= since_ns
    exists = np.arange(window["e"].shape[1]) < window["dof"][late, None]
    total = float(np.sum(np.where(exists, window["e"][late], 0.0) ** 2))
    return total if np.isfinite(total) else np.inf


class Attempt:
    """A correction on trial: what was decided about some sensors before it, and how well that fitted.

    Args:
        sensors: that it is about.   since_ns: onset of the error.
    """

    def __init__(self, engine: Engine, sensors: tuple[int, ...], since_ns: int) -> None:
        self._engine, self._since_ns = engine, since_ns
        reaction = engine.track[0]["reaction"]
        self._was: list[tuple[int, str, NDArray[Any]]] = [
            (sensor, field, np.array(reaction[field][sensor]))
            for sensor in sensors
            for field in reaction.dtype.names
            if reaction.dtype[field].shape
        ]
        self._misfit = misfit(engine, since_ns)

    @property
    def helped(self) -> bool:
        """Whether, replayed, the innovations since the onset have become smaller."""
        return misfit(self._engine, self._since_ns) < self._misfit

    def withdraw(self) -> None:
        """Decide as before about these sensors, and replay."""
        for records in self._engine.histories:
            for sensor, field, value in self._was:
                records["reaction"][field][:, sensor] = value
        self._engine.replay_since(self._since_ns)
