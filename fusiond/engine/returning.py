"""How a sensor that is out returns, and an input that is out is tried: by agreement, or by waiting.

An updating sensor that is excluded is looked at beside the estimate, and may return once its readings have agreed with
it twice. An input that is excluded agrees with nothing, as nothing predicts it: it is tried when it has waited and what
it says is nearer to what stands in for it than to that with its error, and believed when it has waited once more and
raised no alarm. Each relapse doubles the wait. Noise that falls as slowly as its estimate follows raises no alarm
either: whether it is over is looked at from time to time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fusiond.engine.reactions import Reactions, doubled_ns
from fusiond.engine.refine import goes_on, refine
from fusiond.faults.hypotheses import Hypothesis
from fusiond.types import NANOSECONDS, Health, Kind, Role

PROBATION_S = 1.0
"""Shortest probation of a sensor; doubled with every relapse."""
RETRY_S = 5.0
"""Shortest time before an excluded input is tried again, and before it is believed; doubled likewise. Noise that is
estimated is looked at as often."""
QUIET = 1.5**2
"""Noise of less than this, a variance over the declared one, is no fault (any more)."""


def heal(reactions: Reactions, sensor: int, hypotheses: Sequence[Hypothesis]) -> None:
    """An excluded sensor agrees with the estimate: first on probation, then, once it has waited, used again."""
    if sensor not in reactions.out():
        return  # a late reading has had its return looked at once more
    if goes_on(reactions, sensor, hypotheses):
        return
    if reactions.reaction["health"][sensor] != Health.PROBATION:
        reactions.write("health", Health.PROBATION, sensor)
        reactions.write("since_ns", reactions.now_ns, sensor)
    elif _waited_ns(reactions, sensor) >= _wait_ns(reactions, sensor, PROBATION_S):
        reactions.readmit(sensor)
        reactions.clear(sensor)


def retry(reactions: Reactions, hypotheses: Sequence[Hypothesis]) -> None:
    """Do what is due: weigh the kinds of lasting faults again, try inputs that are out, ask whether noise is over."""
    desk = reactions.engine.desk[0]
    if 0 < desk["refine_ns"] <= reactions.now_ns:
        desk["refine_ns"] = 0
        refine(reactions, hypotheses)
    if not 0 < desk["retry_ns"] <= reactions.now_ns:
        return
    desk["retry_ns"] = 0
    for sensor in reactions.layout.sensors:
        number, health = sensor.number, reactions.reaction["health"][sensor.number]
        if health == Health.FAULTY and _is_estimated_noise(reactions, number):
            _ask_whether_noise_is_over(reactions, number)
        elif sensor.role is Role.INPUT and health in (Health.EXCLUDED, Health.PROBATION):
            _try_input(reactions, number)


def schedule(reactions: Reactions, sensor: int) -> None:
    """Set the time at which an input is tried, or believed, from now on."""
    reactions.write("since_ns", reactions.now_ns, sensor)
    _look_again(reactions, _retry_ns(reactions, sensor))


def watch_noise(reactions: Reactions) -> None:
    """Ask later whether noise that is estimated is over."""
    _look_again(reactions, int(RETRY_S * NANOSECONDS))


def _is_estimated_noise(reactions: Reactions, sensor: int) -> bool:
    """Whether the sensor is thought noisy and adaptation is the reaction."""
    return bool(reactions.reaction["kind"][sensor] == Kind.NOISE and reactions.engine.adapts(sensor))


def _ask_whether_noise_is_over(reactions: Reactions, sensor: int) -> None:
    """The sensor is healthy when its noise has fallen to what is declared; else it is asked again."""
    if reactions.noise_ratio(sensor) < QUIET:
        reactions.clear(sensor)
    else:
        watch_noise(reactions)


def _try_input(reactions: Reactions, sensor: int) -> None:
    """Use an excluded input that has waited, on probation; believe one that has waited on probation."""
    left_ns = _retry_ns(reactions, sensor) - _waited_ns(reactions, sensor)
    if left_ns > 0:  # another sensor's turn
        _look_again(reactions, left_ns)
    elif reactions.reaction["health"][sensor] == Health.EXCLUDED and _errs_on(reactions, sensor):
        schedule(reactions, sensor)
    elif reactions.reaction["health"][sensor] == Health.PROBATION:
        reactions.clear(sensor)
    else:
        reactions.readmit(sensor)
        reactions.write("health", Health.PROBATION, sensor)
        schedule(reactions, sensor)


def _errs_on(reactions: Reactions, sensor: int) -> bool:
    """Whether an input that is out reads nearer to what stands in for it with its error than without.

    A machine that does just that is taken for one that errs: its input waits for as long as it does.
    """
    reaction, channel = reactions.reaction, int(reactions.reaction["channel"][sensor])
    readings, kind = reactions.engine.recent(sensor), reaction["kind"][sensor]
    if kind not in (Kind.BIAS, Kind.DRIFT) or channel < 0 or not len(readings):
        return False
    error = float(reaction["size"][sensor])
    if kind == Kind.DRIFT:
        error *= (reactions.now_ns - int(reaction["onset_ns"][sensor])) / NANOSECONDS
    usual = float(reactions.engine.track[0]["monitor"]["usual"][sensor, channel])
    away = float(np.mean(readings["z"][:, channel])) - usual
    return abs(away - error) < abs(away)


def _look_again(reactions: Reactions, wait_ns: int) -> None:
    """Ask for a retry so long from now, unless one is due before."""
    due, planned = reactions.now_ns + wait_ns, int(reactions.engine.desk[0]["retry_ns"])
    reactions.engine.desk[0]["retry_ns"] = min(planned, due) if planned else due


def _waited_ns(reactions: Reactions, sensor: int) -> int:
    """How long the sensor has had the health it has."""
    return reactions.now_ns - int(reactions.reaction["since_ns"][sensor])


def _wait_ns(reactions: Reactions, sensor: int, shortest_s: float) -> int:
    """How long a sensor waits, doubled with every relapse."""
    return doubled_ns(shortest_s, int(reactions.reaction["relapses"][sensor]))


def _retry_ns(reactions: Reactions, sensor: int) -> int:
    """How long an excluded input waits: it cannot show that an error has gone, but that it sends numbers again."""
    unusable = reactions.reaction["kind"][sensor] in (Kind.STUCK, Kind.GARBAGE, Kind.SPIKE)
    return _wait_ns(reactions, sensor, PROBATION_S if unusable else RETRY_S)
