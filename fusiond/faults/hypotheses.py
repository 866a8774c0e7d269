"""Hypotheses: what may be wrong, where, and how the error of a reading then goes with time.

A hypothesis has parts; the channels of one part err by one common size, each part by its own. From the onset on the
error is f = size * p, p the profile of its kind:

| kind | p | size |
|---|---|---|
| bias | 1 | in the channel's unit |
| drift | t - onset, s | in the channel's unit per second |
| scale | h, the predicted reading | a factor less one |
| delay | -dh/dt | seconds |
| spike | 1 at the onset, 0 thereafter | in the channel's unit |
| noise | none: the variance changes | a factor of the standard deviation |

For an input only bias, drift and spike: what it should have read is not in the window. A spike of an input is a run of
readings unlike its usual ones; without such there is none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fusiond.faults.course import Suspect
from fusiond.types import Kind

Place = tuple[int, ...]
"""Numbers of the sensors that share a fault, ascending."""


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """One explanation.

    Args:
        kind: of the fault.   parts: the channels that err by one size, for each size.
    """

    kind: Kind
    parts: tuple[tuple[Suspect, ...], ...]

    @property
    def place(self) -> Place:
        """Where the fault sits."""
        return tuple(sorted({suspect.sensor for part in self.parts for suspect in part}))


def _of_sensor(sensor: int, dof: int) -> list[Hypothesis]:
    """Each channel alone, and all of them: each by its own size where its unit is its own, else by one."""
    channels = [Suspect(sensor, channel, False) for channel in range(dof)]
    alone = [((suspect,),) for suspect in channels]
    each = tuple((suspect,) for suspect in channels)
    together = (tuple(channels),)
    several = dof > 1
    found = [Hypothesis(kind, parts) for kind in (Kind.BIAS, Kind.DRIFT, Kind.SCALE) for parts in alone]
    found += [Hypothesis(kind, each) for kind in (Kind.BIAS, Kind.DRIFT) if several]
    found += [Hypothesis(Kind.SCALE, together)] if several else []
    found += [
        Hypothesis(Kind.DELAY, together),
        Hypothesis(Kind.SPIKE, each),
        Hypothesis(Kind.NOISE, together),
    ]
    return found


def catalogue(
    dofs: Mapping[int, int],
    inputs: Mapping[int, Sequence[int]] | None = None,
    groups: Sequence[Sequence[int]] = (),
) -> tuple[Hypothesis, ...]:
    """Every single explanation that is looked for.

    Args:
        dofs: scalar channels of each updating sensor, by its number.
        inputs: numbers of the process inputs each input sensor drives, by the sensor's number.
        groups: updating sensors that may share one fault: channel by channel one size for all of them.
    """
    found = [hypothesis for sensor, dof in dofs.items() for hypothesis in _of_sensor(sensor, dof)]
    for sensor, numbers in (inputs or {}).items():
        for kind in (Kind.BIAS, Kind.DRIFT, Kind.SPIKE):
            found += [Hypothesis(kind, ((Suspect(sensor, number, True),),)) for number in numbers]
    for group in groups:
        width = min((dofs[sensor] for sensor in group), default=0)
        per_channel = tuple(
            tuple(Suspect(sensor, channel, False) for sensor in group) for channel in range(width)
        )
        every = (tuple(suspect for part in per_channel for suspect in part),)
        if len(group) > 1 and width:
            found += [Hypothesis(kind, per_channel) for kind in (Kind.BIAS, Kind.DRIFT)]
            found += [Hypothesis(kind, every) for kind in (Kind.SCALE, Kind.DELAY)]
    return tuple(found)
