"""Seed 000's four scenarios: one plant, one PD law, four sources of feedback.

    ideal                 the true position and velocity
    accelerometer_only    its reading integrated twice from the known start
    ultrasonic_only       its reading, and the difference of the last two over their time
    fused                 whatever estimator the caller brings; none is known here

The law is u = Kp (x_d - x) - Kv v + m g (eq 24 and 28), held for a millisecond and saturated at m g +- 1 N.
The seed speaks of a saturation and gives no number: 1 N is assumed, and around the weight for the bi-rotor,
since +-1 N around zero could not even carry its 4.9 N.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fusiond.simulation.plants import PointState
from fusiond.simulation.rig import STEP_NS, PointRig
from fusiond.simulation.tables import Floats, Reading, Times
from fusiond.types import NANOSECONDS, nanoseconds


class Moment(NamedTuple):
    """What there is to feed back at one time. A sensor that has no reading now is None."""

    t_ns: int
    truth: PointState
    acceleration_m_s2: float | None
    ultrasonic_m: float | None


Feedback = Callable[[Moment], tuple[float, float]]
Estimator = Callable[[int, float | None, float | None], tuple[float, float]]


@dataclass(frozen=True, slots=True)
class PdLaw:
    """u = clip(kp (goal - x) - kv v, +-limit) + weight, in newtons."""

    goal_m: float
    weight_n: float = 0.0
    kp: float = 1.0
    kv: float = 1.0
    limit_n: float = 1.0

    def force(self, position_m: float, velocity_m_s: float) -> float:
        """The force for this position and velocity."""
        asked = self.kp * (self.goal_m - position_m) - self.kv * velocity_m_s
        return self.weight_n + min(max(asked, -self.limit_n), self.limit_n)


@dataclass(frozen=True, slots=True)
class LoopRun:
    """A closed loop, one row a millisecond. fed_back: (n, 2) position and velocity the law was given.

    force_n[k] acts from t_ns[k] on; states[k] are position, velocity, and the acceleration over the
    millisecond before.
    """

    t_ns: Times
    states: Floats
    fed_back: Floats
    force_n: Floats
    readings: tuple[Reading, ...]

    def rms_from(self, goal_m: float, last_s: float) -> float:
        """Root mean square distance from the goal over the last seconds, in metres."""
        late = self.t_ns >= self.t_ns[-1] - nanoseconds(last_s)
        return float(np.sqrt(np.mean((self.states[late, 0] - goal_m) ** 2)))


def run(rig: PointRig, law: PdLaw, feedback: Feedback, duration_ns: int) -> LoopRun:
    """Close the loop from t = 0 to the duration, in milliseconds."""
    readings = rig.begin()
    now = readings
    states: list[PointState] = []
    fed_back: list[tuple[float, float]] = []
    forces: list[float] = []
    for step in range(duration_ns // STEP_NS + 1):
        if step:
            now = rig.advance(forces[-1])
            readings.extend(now)
        fed_back.append(feedback(_moment(rig, now)))
        forces.append(law.force(*fed_back[-1]))
        states.append(rig.state)
    t_ns = np.arange(len(states), dtype=np.int64) * STEP_NS
    return LoopRun(t_ns, np.array(states), np.array(fed_back), np.array(forces), tuple(readings))


def _moment(rig: PointRig, now: list[Reading]) -> Moment:
    values = {reading.sensor: reading.z[0] for reading in now}
    return Moment(rig.t_ns, rig.state, values.get("accelerometer"), values.get("ultrasonic"))


def ideal() -> Feedback:
    """The truth itself."""
    return lambda moment: (moment.truth.position_m, moment.truth.velocity_m_s)


def accelerometer_only(start: PointState) -> Feedback:
    """Eq 11 and 12: the reading, offset and all, integrated twice from the true start."""
    position, velocity, dt_s = start.position_m, start.velocity_m_s, STEP_NS / NANOSECONDS

    def feedback(moment: Moment) -> tuple[float, float]:
        nonlocal position, velocity
        if moment.acceleration_m_s2 is not None:
            position += velocity * dt_s + 0.5 * moment.acceleration_m_s2 * dt_s**2
            velocity += moment.acceleration_m_s2 * dt_s
        return position, velocity

    return feedback


def ultrasonic_only(start: PointState) -> Feedback:
    """The last reading, and the difference of the last two over their time; before that, the start."""
    position, velocity, last_ns = start.position_m, start.velocity_m_s, -1

    def feedback(moment: Moment) -> tuple[float, float]:
        nonlocal position, velocity, last_ns
        if moment.ultrasonic_m is not None:
            if last_ns >= 0:
                velocity = (moment.ultrasonic_m - position) / ((moment.t_ns - last_ns) / NANOSECONDS)
            position, last_ns = moment.ultrasonic_m, moment.t_ns
        return position, velocity

    return feedback


def fused(estimator: Estimator) -> Feedback:
    """An estimator from outside: (t_ns, acceleration or None, ultrasonic or None) -> (position, velocity).

    It is never shown the truth.
    """
    return lambda moment: estimator(moment.t_ns, moment.acceleration_m_s2, moment.ultrasonic_m)
