"""A sensor that cannot be spared, used with its error taken off: taken off, taken off anew, or no longer.

A lasting error is found once, and what is found later refines it a few times. Where a sensor keeps erring anew no error
of a lasting shape is there: it wanders, or the model does and the sensor alone tells the truth. Whoever took each of
these errors off would follow the model anywhere. So after `MOST` of them, or where one did not make the innovations
smaller, the model is blamed. Nothing that was found by such a model is kept: all readings are believed as they are,
the estimate is as unsure again as it was at first, so that they lead it back, and nothing is taken off them for a
while, twice as long each time.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum

from fusiond.engine.correction import (
    LASTING,
    Attempt,
    add_correction,
    drop_correction,
    end_correction,
    left_over,
    once_gone,
    total_taken_off,
    unsure,
)
from fusiond.engine.reactions import DOUBLINGS, Reactions, doubled_ns
from fusiond.faults.ending import Ending, find_ending
from fusiond.faults.glr import Fit
from fusiond.faults.isolation import Finding, Outcome
from fusiond.faults.kinds import FAMILY
from fusiond.faults.response import Response
from fusiond.types import Health, Kind, Role

MOST = 4
"""Times a sensor's error may become another one before the sensor is believed as it is."""
BAR_S = 30.0
"""Shortest time for which nothing is taken off then; doubled each time."""
SURE = 3.0
"""Standard deviations within which a remaining error is none."""
SHAPELY = 0.1
"""No error keeps the shape that was taken off better than to this share of it."""


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


def corrected(reactions: Reactions) -> list[int]:
    """Numbers of the sensors that an error is taken off."""
    return [sensor for sensor in range(len(reactions.reaction["health"])) if is_corrected(reactions, sensor)]


def end_gone(reactions: Reactions, finding: Finding, lead_of_another: Callable[[int], float]) -> bool:
    """Take no more off a sensor where its error having gone explains the innovations as well as anything; whether so.

    It is asked of every sensor that an error is taken off, whomever the finding names: where the error was not quite of
    the shape that was taken off, another sensor's fault may imitate its end.

    Args:
        lead_of_another: of a sensor, how much better another kind explains all than what is taken off.
    """
    fit = finding.fit
    if fit is None:
        return False
    best = fit.score + (finding.margin if finding.outcome is Outcome.MODEL else 0.0)
    endings = [
        (ending, sensor)
        for sensor in corrected(reactions)
        if (ending := _ending(reactions, sensor, fit.ground.response))
    ]
    ending, sensor = max(endings, key=lambda one: one[0].score, default=(None, -1))
    if ending is None or ending.score < max(best, FAMILY, lead_of_another(sensor)):
        return False
    end_correction(reactions, sensor, ending.onset)
    reactions.clear(sensor)
    reactions.replay()
    return True


def _ending(reactions: Reactions, sensor: int, response: Response) -> Ending | None:
    """When the error taken off a sensor has gone, most likely."""
    layout, of = reactions.layout, reactions.layout.sensors[sensor]
    drives: tuple[int, ...] = ()
    if of.role is Role.INPUT:
        names = [slot.name for slot in layout.inputs]
        drives = tuple(names.index(channel.name) for channel in of.channels)
    left = once_gone(reactions.window, reactions.reaction, sensor, drives)
    return find_ending(response, sensor, drives, left, max(unsure(reactions, sensor), SHAPELY))


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
        end_correction(reactions, sensor, fit.onset)
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
    for sensor in corrected(reactions):
        times = int(reactions.reaction["barred"][sensor])
        reactions.write("barred_ns", reactions.now_ns + doubled_ns(BAR_S, times), sensor)
        reactions.write("barred", min(times, DOUBLINGS) + 1, sensor)
        drop_correction(reactions, sensor, fit.onset)
        reactions.clear(sensor)
        reactions.write("health", Health.SUSPECT, sensor)
