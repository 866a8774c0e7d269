"""A sensor that cannot be spared, used with its error taken off: taken off, taken off anew, or no longer.

A lasting error is found once, and what is found later refines it a few times. Where a sensor keeps erring anew no error
of a lasting shape is there: it wanders, or the model does and the sensor alone tells the truth. Whoever took each of
these errors off would follow the model anywhere. So after `MOST` of them, or where one did not make the innovations
smaller, the model is blamed. Nothing that was found by such a model is kept: all readings are believed as they are,
the estimate is as unsure again as it was at first, so that they lead it back, and nothing is taken off them for a
while, twice as long each time.
"""

from __future__ import annotations

from enum import IntEnum

from fusiond.engine.correction import (
    LASTING,
    Attempt,
    add_correction,
    drop_correction,
    end_correction,
    left_over,
    total_taken_off,
)
from fusiond.engine.reactions import DOUBLINGS, Reactions, doubled_ns
from fusiond.faults.glr import Fit
from fusiond.types import Health, Kind

MOST = 4
"""Times a sensor's error may become another one before the sensor is believed as it is."""
BAR_S = 30.0
"""Shortest time for which nothing is taken off then; doubled each time."""
SURE = 3.0
"""Standard deviations within which a remaining error is none."""


class Taken(IntEnum):
    """What became of an error that was found."""

    OFF = 0
    NO_MORE = 1
    """the sensor has healed"""
    NOT = 2
    """the readings are believed as they are"""


def take_off(reactions: Reactions, sensors: tuple[int, ...], fit: Fit, kind: Kind) -> bool:
    """Use sensors with the error found taken off, and replay.

    Returns: whether that holds; False where nothing is taken off, or it was withdrawn as it made matters worse.
    """
    attempt = Attempt(reactions.engine, sensors, reactions.onset_ns(fit.onset))
    revised = [sensor for sensor in sensors if is_corrected(reactions, sensor)]
    done = [(_revise if sensor in revised else _first)(reactions, sensor, fit, kind) for sensor in sensors]
    reactions.replay()
    if Taken.OFF not in done or attempt.helped:
        return Taken.NOT not in done
    attempt.withdraw()
    if revised:
        _give_up(reactions, fit)
        reactions.replay()
    return False


def is_corrected(reactions: Reactions, sensor: int) -> bool:
    """Whether an error of the sensor is taken off already."""
    reaction = reactions.reaction
    return bool(reaction["health"][sensor] == Health.FAULTY and reaction["kind"][sensor] in LASTING)


def _first(reactions: Reactions, sensor: int, fit: Fit, kind: Kind) -> Taken:
    """Take the first error of a sensor off, unless that has led nowhere lately."""
    if reactions.now_ns < int(reactions.reaction["barred_ns"][sensor]):
        reactions.name(sensor, fit, kind, Health.SUSPECT)
        return Taken.NOT
    reactions.name(sensor, fit, kind, Health.FAULTY)
    reactions.write("revisions", 0, sensor)
    add_correction(reactions, sensor, fit, kind)
    return Taken.OFF


def _revise(reactions: Reactions, sensor: int, fit: Fit, kind: Kind) -> Taken:
    """A sensor used with its error taken off errs anew: it has healed, the error is another one, or there is none."""
    left, std = left_over(reactions, sensor, fit, kind)
    slack = 0.0 if kind in (Kind.SCALE, Kind.DELAY) else reactions.noise(sensor)
    if abs(left) < SURE * std + slack:
        end_correction(reactions, sensor, fit)
        reactions.clear(sensor)
        return Taken.NO_MORE
    count = int(reactions.reaction["revisions"][sensor]) + 1
    reactions.write("revisions", count, sensor)
    if count > MOST:
        _give_up(reactions, fit)
        return Taken.NOT
    add_correction(reactions, sensor, fit, kind)
    reactions.name(sensor, fit, kind, Health.FAULTY)
    reactions.write("size", total_taken_off(reactions, sensor, kind), sensor)
    return Taken.OFF


def _give_up(reactions: Reactions, fit: Fit) -> None:
    """Believe all readings as they are from the fit's onset on, and bar those that were corrected from correction."""
    corrected = [
        sensor for sensor in range(len(reactions.reaction["health"])) if is_corrected(reactions, sensor)
    ]
    for sensor in corrected:
        times = int(reactions.reaction["barred"][sensor])
        reactions.write("barred_ns", reactions.now_ns + doubled_ns(BAR_S, times), sensor)
        reactions.write("barred", min(times, DOUBLINGS) + 1, sensor)
        drop_correction(reactions, sensor, fit.onset)
        reactions.clear(sensor)
        reactions.write("health", Health.SUSPECT, sensor)
