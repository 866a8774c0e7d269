"""The judge of alarms: who is wrong, what is done about it, and when a sensor is taken back.

Theory of operation. The compiled step only raises alarms; it stops with the reading that raised one, and the judge
decides before the next is looked at. Health of a sensor, and what moves it:

| from | on | to | and the estimator |
|---|---|---|---|
| healthy | an alarm that one reading of a sensor alone explains | healthy | waits for the next; a spike is forgotten |
| healthy | an alarm that isolation cannot settle yet | suspect | goes on; the case is reviewed as readings come |
| healthy, suspect | isolated; the rest sees every state | excluded | becomes the filter that never had the sensor |
| healthy, suspect | isolated; the rest does not | faulty | takes the error off every reading since the onset |
| healthy, suspect | isolated; noise | faulty | weighs the readings by the noise they have (adaptation: does already) |
| healthy | one of a set that nothing tells apart | suspect | weighs the whole set down so as to cover all |
| any | frozen, or nothing that could be used | excluded | does without it, whatever is left |
| faulty | the error has gone, or its noise has fallen however slowly | healthy | believes the readings as they are |
| excluded | it agrees with the estimate, or lives where that is too unsure to say | probation | does without it |
| excluded input | it has waited | probation | tries it |
| probation | they agree once more, and it has waited | healthy | uses it again |

Where no sensor explains the innovations the model is blamed, and no sensor is touched. Whoever falls ill again waits
twice as long to return. A decision reaches all snapshots, so that a late reading cannot undo it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.engine.reactions import Reactions
from fusiond.engine.refine import goes_on, is_watched, lead_of_another, refine, refine_one, watch
from fusiond.engine.revising import end_gone, is_corrected, take_off
from fusiond.faults.course import Suspect
from fusiond.faults.forecast import worst_error
from fusiond.faults.glr import Fit
from fusiond.faults.ground import burst_of
from fusiond.faults.hypotheses import Hypothesis
from fusiond.faults.isolation import Finding, Outcome, Twins, isolate
from fusiond.faults.response import respond
from fusiond.faults.tolerated import tolerate
from fusiond.types import NANOSECONDS, Alarm, Health, Kind, Role

if TYPE_CHECKING:
    from fusiond.engine.engine import Engine

PATIENCE = 0.25
"""A case left open is reviewed when its readings have grown by this share."""
STEPS, LEAST = 128, 16
"""A window is worth looking at again after this part of it, a set that nothing tells apart after so many of those."""
CALM_WINDOWS = 16
"""Windows after which too little scatter is looked into again at the latest."""
PROBATION_S = 1.0
"""Shortest probation of a sensor; doubled with every relapse."""
RETRY_S = 5.0
"""Shortest time before an excluded input is tried again, and before it is believed; doubled likewise. Noise that is
estimated is looked at as often."""
QUIET = 1.5**2
"""Noise of less than this, a variance over the declared one, is no fault (any more)."""
RELAPSES = 6
"""Relapses after which waiting grows no longer."""
SINGLE = 2
"""Odd readings of an input that are a spike, which changes no flag; more are a fault."""
BEYOND = 2.0
"""Standard deviations by which an error must exceed what is tolerated."""
LARGEST_NOISE = 100.0
"""Beyond this factor of its declared noise a sensor that can be spared is excluded."""


@dataclass(frozen=True, slots=True)
class Judge:
    """Decides about alarms; whatever it decides it writes into the engine's records.

    Args:
        hypotheses: all explanations tried.   enough: whether every state is still seen without these sensors.
        noise_std: (s, m) declared deviations.   tolerance: of each suspect, a bias that is no fault.
        policy: of each sensor, auto, exclude or compensate.
        twins: pairs of updating sensors that the diagnosability matrix calls ambiguous.
        replaceable: whether an input has something to fall back on.   silence_ns: (s,) longest healthy silence, 0: any.
    """

    layout: Layout
    hypotheses: tuple[Hypothesis, ...]
    enough: Callable[[frozenset[int]], bool]
    noise_std: NDArray[np.float64]
    tolerance: dict[Suspect, float]
    twins: frozenset[frozenset[int]]
    policy: tuple[str, ...]
    replaceable: tuple[bool, ...]
    silence_ns: NDArray[np.int64]

    @property
    def _step(self) -> int:
        """Readings that bring something new to a window."""
        return max(1, self.layout.shape.window // STEPS)

    def consider(self, engine: Engine) -> None:
        """Decide about the alarm raised by the reading just applied, and about those that its decision raises."""
        for _ in range(len(self.layout.sensors) + 1):
            monitor = engine.track[0]["monitor"]
            alarm, sensor = Alarm(int(monitor["alarm"])), int(monitor["alarm_sensor"])
            too_calm = alarm is Alarm.POOLED and int(monitor["alarm_cell"]) == 1
            monitor["alarm"] = Alarm.NONE
            reactions = Reactions(engine, self.noise_std)
            match alarm:
                case Alarm.NONE:
                    return
                case Alarm.FROZEN | Alarm.GARBAGE:
                    self._unusable(reactions, sensor, Kind.STUCK if alarm is Alarm.FROZEN else Kind.GARBAGE)
                case Alarm.HEALED:
                    self._healed(reactions, sensor)
                case Alarm.RETRY:
                    self._retry(reactions)
                case _ if too_calm:
                    self._weigh_calm(reactions)
                case _:
                    self._weigh(reactions, alarm)

    def _weigh_calm(self, reactions: Reactions) -> None:
        """All innovations scatter less than declared: the end of a noise, the model, or a declaration that is cautious.

        No error makes them do so: whatever else isolation finds at this moment has raised no alarm. Where it is nothing
        one asks half as often every time. Every other alarm is weighed as ever.
        """
        desk, entries = reactions.engine.desk[0], reactions.entries
        if entries < max(int(desk["calm_until"]), int(desk["review_at"])):
            return
        finding = self._finding(reactions)
        noise = finding.fit is not None and finding.fit.kind is Kind.NOISE
        if finding.outcome is Outcome.MODEL or (noise and self._matters(reactions, finding)):
            desk["calm_for"] = 0
            self._weigh(reactions, Alarm.POOLED, finding)
            return
        shortest, longest = LEAST * self._step, CALM_WINDOWS * self.layout.shape.window
        desk["calm_for"] = min(max(shortest, 2 * int(desk["calm_for"])), longest)
        desk["calm_until"] = entries + desk["calm_for"]

    def _weigh(self, reactions: Reactions, alarm: Alarm, found: Finding | None = None) -> None:
        """Ask isolation, and do what follows from its answer; alarms within an open case wait for its review.

        A late reading has the same evidence raise its alarm once more: it is not asked again whether that is nothing.

        Args:
            found: its answer, where it was asked already.
        """
        engine = reactions.engine
        desk, entries = engine.desk[0], reactions.entries
        if alarm is not Alarm.REVIEW and (entries < desk["review_at"] or entries == desk["nothing_at"]):
            return
        if desk["case_at"] == 0:
            desk["case_at"] = entries
        finding = found or self._finding(reactions)
        if finding.outcome is not Outcome.MODEL and not self._matters(reactions, finding):
            reactions.close()
            return
        age = entries - int(desk["case_at"])
        undecided = finding.outcome is Outcome.UNDECIDED
        if finding.fit is not None and finding.fit.kind is not Kind.NOISE:
            reactions.freeze(finding.sensors)
        if self._alone(reactions, finding) and age <= self.layout.shape.window // 2:
            desk["review_at"] = entries + (self._step if age > 0 else self._until_next(reactions, finding))
        elif self._bad_sample(reactions, finding) or self._end_gone(reactions, finding):
            reactions.close()
        elif undecided and age <= self.layout.shape.window // 2:
            desk["review_at"] = entries + max(self._step, int(PATIENCE * age))
            if age > 0:
                reactions.suspect(finding.sensors)
        elif finding.outcome is Outcome.MODEL:
            self._blame_model(reactions)
        elif finding.outcome is Outcome.AMBIGUOUS or (undecided and len(finding.sensors) > 1):
            reactions.cover(finding)
            reactions.recall_noise(finding.sensors, finding.fit.onset if finding.fit else 0)
            desk["review_at"] = entries + max(LEAST * self._step, int(PATIENCE * age))
        else:
            reactions.close()
            if finding.outcome is Outcome.NOTHING:
                desk["nothing_at"] = entries
            if finding.outcome in (Outcome.ONE, Outcome.GROUP):
                self._react(reactions, finding)

    def _alone(self, reactions: Reactions, finding: Finding) -> bool:
        """Whether a single reading of the sensor says it all: that may be a bad sample, which its next one tells.

        Nor are one bad and one sound reading scatter.
        """
        fit = finding.fit
        if fit is None or fit.ground.is_input:
            return False
        since = reactions.window["sensor"][fit.onset :]
        return int(np.isin(since, fit.place).sum()) <= (2 if fit.kind is Kind.NOISE else 1) * len(fit.place)

    def _until_next(self, reactions: Reactions, finding: Finding) -> int:
        """Entries until the sensor's next reading is to be expected: as many as to its last one."""
        place = finding.fit.place if finding.fit else ()
        own = np.flatnonzero(np.isin(reactions.window["sensor"], place))
        return int(own[-1] - own[-2]) if len(own) > 1 else 1

    def _bad_sample(self, reactions: Reactions, finding: Finding) -> bool:
        """Whether the reading that raised the alarm, or one before, was a spike, and its sensor is sound since."""
        fit = finding.fit
        if fit is None or fit.ground.is_input or fit.kind is not Kind.SPIKE:
            return False
        entry = reactions.entries - reactions.age_of(fit.onset)
        return entry < int(reactions.engine.desk[0]["case_at"])

    def _matters(self, reactions: Reactions, finding: Finding) -> bool:
        """Whether it is a fault: no error within tolerance, no less noise than declared."""
        fit = finding.choice.fit or finding.fit
        if fit is None:
            return True
        if fit.kind is Kind.NOISE:
            return self._noisy(reactions, fit)
        tolerance = {suspect: self.tolerance.get(suspect, 0.0) for suspect in worst_error(fit)}
        surely = worst_error(fit, BEYOND)
        return any(limit <= 0.0 or surely[suspect] > limit for suspect, limit in tolerance.items())

    def _noisy(self, reactions: Reactions, fit: Fit) -> bool:
        """Whether a change of noise is a fault: more than tolerated, or the end of one."""
        if set(fit.place) & (self._restless(reactions) | self._weighed_down(reactions)):
            return True
        excess = math.sqrt(max(float(fit.size[0]) ** 2 - 1.0, 0.0))
        members = [suspect for part in fit.hypothesis.parts for suspect in part]
        return any(
            excess * math.sqrt(reactions.noise_ratio(one.sensor)) * self.noise_std[one.sensor, one.channel]
            > self.tolerance.get(one, 0.0)
            for one in members
        )

    def _restless(self, reactions: Reactions) -> frozenset[int]:
        """Sensors thought noisier than declared, whose noise may become less: not those of a set that is covered."""
        noisy = frozenset(int(k) for k in np.flatnonzero(reactions.reaction["kind"] == Kind.NOISE))
        return noisy if reactions.adapts else noisy & self._weighed_down(reactions)

    def _weighed_down(self, reactions: Reactions) -> frozenset[int]:
        """Sensors that count for less than their noise, as they are found noisy or as their set is covered."""
        return frozenset(int(k) for k in np.flatnonzero(reactions.reaction["noise_excess"] > 0.0))

    def _finding(self, reactions: Reactions) -> Finding:
        """What isolation says about the window now; who is out or silent has nothing to plead."""
        track = reactions.engine.track[0]
        age_ns = int(track["t_ns"]) - track["sensor_t_ns"]
        silent = {int(k) for k in np.flatnonzero((self.silence_ns > 0) & (age_ns > self.silence_ns))}
        out = reactions.out() | silent
        asked = [h for h in self.hypotheses if not set(h.place) & out]
        noisy = self._restless(reactions)
        covered = self._weighed_down(reactions) - noisy
        seen = tolerate(respond(reactions.window, self.layout.shape.inputs), self.tolerance)
        return isolate(seen, asked, restless=noisy, twins=Twins(self.twins, covered))

    def _excludable(self, reactions: Reactions, sensor: int, together: tuple[int, ...]) -> bool:
        """Whether the sensor, with all that are out or go out with it, can be done without.

        To take its error off instead was asked for an error that is known. Who errs on all the same is done without.
        """
        if self.policy[sensor] == "compensate" and not is_corrected(reactions, sensor):
            return False
        if self.layout.sensors[sensor].role is Role.INPUT:
            return self.replaceable[sensor]
        return self._spared(reactions, together)

    def _spared(self, reactions: Reactions, sensors: tuple[int, ...]) -> bool:
        """Whether every state is still seen without these and all that are out."""
        gone = {*reactions.out(), *sensors}
        return self.enough(frozenset(s for s in gone if self.layout.sensors[s].role is Role.UPDATE))

    def _react(self, reactions: Reactions, finding: Finding) -> None:
        """One sensor, or a group with one fault, is named: exclude it, or use it with its error taken off."""
        fit, kind = finding.choice.fit or finding.fit, finding.choice.kind
        assert fit is not None
        if kind is Kind.SPIKE:
            self._burst(reactions, fit)
            return
        if kind is Kind.NOISE:
            self._weigh_down(reactions, fit)
            return
        kept = []
        for sensor in fit.place:
            spared = self._excludable(reactions, sensor, fit.place)
            if is_corrected(reactions, sensor) and not spared:
                if not (is_watched(reactions, sensor) and self._is_another(reactions, sensor)):
                    kept.append(sensor)
            elif spared:
                if is_corrected(reactions, sensor):
                    reactions.drop_correction(sensor, fit.onset)
                found = reactions.name(sensor, fit, kind, Health.EXCLUDED)
                self._send_out(reactions, sensor, fit)
                watch(reactions, sensor, fit.place, found.onset_std_s)
            else:
                kept.append(sensor)
        if not kept:
            reactions.replay()
        elif take_off(reactions, tuple(kept), fit, kind):
            for sensor in filter(partial(is_corrected, reactions), kept):
                watch(reactions, sensor, fit.place, 0.0)
        else:
            self._blame_model(reactions)

    def _blame_model(self, reactions: Reactions) -> None:
        """No sensor's fault explains the innovations: touch none, and look again ever later, after a window at most.

        Soon at first: a sensor may begin to err while the model is blamed.
        """
        desk, entries = reactions.engine.desk[0], reactions.entries
        reactions.write("model", 1)
        desk["case_at"] = desk["case_at"] or entries
        wait = max(LEAST * self._step, int(PATIENCE * (entries - int(desk["case_at"]))))
        desk["review_at"] = entries + min(wait, self.layout.shape.window)

    def _is_another(self, reactions: Reactions, sensor: int) -> bool:
        """Whether all that is known since the onset says that the error taken off is of another kind."""
        return refine_one(reactions, sensor, self.hypotheses, self.noise_std, reactions.engine.window)

    def _end_gone(self, reactions: Reactions, finding: Finding) -> bool:
        """Whether an error that is taken off has gone, which explains it all; an error of another kind has not."""
        lead = partial(lead_of_another, reactions, self.hypotheses, self.noise_std)
        return end_gone(reactions, finding, lead)

    def _burst(self, reactions: Reactions, fit: Fit) -> None:
        """A spike of a sensor has been gated; one of an input is taken out, and a long one tells of its sensor."""
        if not fit.ground.is_input:
            return
        (sensor,) = fit.place
        number = fit.hypothesis.parts[0][0].channel
        entries = fit.ground.entries[burst_of(fit.ground, fit.hypothesis) == fit.number]
        readings = int(np.sum(fit.ground.response.odd_count[entries, number]))
        if (readings > SINGLE or len(entries) > 1) and self._excludable(reactions, sensor, fit.place):
            reactions.name(sensor, fit, Kind.SPIKE, Health.EXCLUDED)
            self._send_out(reactions, sensor, fit)
        else:
            reactions.leave_out(sensor, fit.onset, int(entries[-1]))
        reactions.replay()

    def _send_out(self, reactions: Reactions, sensor: int, fit: Fit) -> None:
        """Exclude a sensor whose fault began with the fit's onset."""
        reactions.exclude(sensor, fit.onset)
        reactions.expect(sensor, fit.kind, reactions.sizes(sensor, fit))
        if self.layout.sensors[sensor].role is Role.INPUT:
            self._schedule(reactions, sensor)

    def _schedule(self, reactions: Reactions, sensor: int) -> None:
        """Set the time at which an input is looked at again."""
        reactions.write("since_ns", reactions.now_ns, sensor)
        self._look_again(reactions, self._retry_ns(reactions, sensor))

    def _look_again(self, reactions: Reactions, wait_ns: int) -> None:
        """Ask for a retry so long from now, unless one is due before."""
        due, planned = reactions.now_ns + wait_ns, int(reactions.engine.desk[0]["retry_ns"])
        reactions.engine.desk[0]["retry_ns"] = min(planned, due) if planned else due

    def _wait_ns(self, reactions: Reactions, sensor: int, shortest_s: float) -> int:
        """How long a sensor waits, doubled with every relapse."""
        relapses = min(int(reactions.reaction["relapses"][sensor]), RELAPSES)
        return int(shortest_s * 2.0**relapses * NANOSECONDS)

    def _retry_ns(self, reactions: Reactions, sensor: int) -> int:
        """How long an excluded input waits: it cannot show that an error has gone, but that it sends numbers again."""
        unusable = reactions.reaction["kind"][sensor] in (Kind.STUCK, Kind.GARBAGE, Kind.SPIKE)
        return self._wait_ns(reactions, sensor, PROBATION_S if unusable else RETRY_S)

    def _weigh_down(self, reactions: Reactions, fit: Fit) -> None:
        """The sensor is noisier, or quieter again, than was thought: use the noise it has.

        Where the sensor's noise is estimated that is done already, and the monitors alone are told.
        """
        for sensor in fit.place:
            if is_corrected(reactions, sensor):
                reactions.end_correction(sensor, fit.onset)
            variance = float(fit.size[0]) ** 2 * reactions.noise_ratio(sensor)
            estimated = reactions.engine.adapts(sensor)
            if estimated:
                reactions.scale_noise(sensor, float(fit.size[0]) ** 2)
            if variance < QUIET:
                reactions.clear(sensor)
            elif variance > LARGEST_NOISE**2 and self._excludable(reactions, sensor, fit.place):
                reactions.name(sensor, fit, Kind.NOISE, Health.EXCLUDED)
                self._send_out(reactions, sensor, fit)
            else:
                reactions.name(sensor, fit, Kind.NOISE, Health.FAULTY)
                reactions.write("size", float(np.sqrt(variance)), sensor)
                if estimated:
                    self._look_again(reactions, int(RETRY_S * NANOSECONDS))
                else:
                    reactions.write("noise_excess", variance - 1.0, sensor)
        reactions.since(fit.onset)
        reactions.replay()

    def _estimates_noise(self, reactions: Reactions, sensor: int) -> bool:
        """Whether the sensor is thought noisy and adaptation is the reaction."""
        return bool(reactions.reaction["kind"][sensor] == Kind.NOISE and reactions.engine.adapts(sensor))

    def _unusable(self, reactions: Reactions, sensor: int, kind: Kind) -> None:
        """Its readings are frozen, or cannot be used at all."""
        if sensor in reactions.out():
            return
        onset = reactions.run_began(sensor) if kind is Kind.STUCK else len(reactions.window)
        reactions.close()
        if is_corrected(reactions, sensor):
            reactions.drop_correction(sensor, onset)
        reactions.name_unusable(sensor, kind, onset)
        reactions.exclude(sensor, onset, spared=self._spared(reactions, (sensor,)))
        reactions.expect(sensor, kind, {})
        if self.layout.sensors[sensor].role is Role.INPUT:
            self._schedule(reactions, sensor)
        reactions.replay()

    def _healed(self, reactions: Reactions, sensor: int) -> None:
        """An excluded sensor agrees with the estimate: first on probation, then, once it has waited, used again."""
        if sensor not in reactions.out():
            return  # a late reading has had its return looked at once more
        if goes_on(reactions, sensor, self.hypotheses, self.noise_std):
            return
        if reactions.reaction["health"][sensor] != Health.PROBATION:
            reactions.write("health", Health.PROBATION, sensor)
            reactions.write("since_ns", reactions.now_ns, sensor)
        elif reactions.now_ns - reactions.reaction["since_ns"][sensor] >= self._wait_ns(
            reactions, sensor, PROBATION_S
        ):
            reactions.readmit(sensor)
            reactions.clear(sensor)

    def _retry(self, reactions: Reactions) -> None:
        """Try excluded inputs that have waited, and believe those that were tried and raised no alarm.

        Of other sensors that are out or corrected the kind of fault is weighed again. Noise that falls slowly raises no
        alarm, as its estimate keeps up with it: whether it is over is looked at here.
        """
        desk = reactions.engine.desk[0]
        if 0 < desk["refine_ns"] <= reactions.now_ns:
            desk["refine_ns"] = 0
            refine(reactions, self.hypotheses, self.noise_std)
        if not 0 < desk["retry_ns"] <= reactions.now_ns:
            return
        desk["retry_ns"] = 0
        for sensor in self.layout.sensors:
            number, health = sensor.number, reactions.reaction["health"][sensor.number]
            if health == Health.FAULTY and self._estimates_noise(reactions, number):
                if reactions.noise_ratio(number) < QUIET:
                    reactions.clear(number)
                else:
                    self._look_again(reactions, int(RETRY_S * NANOSECONDS))
            if sensor.role is not Role.INPUT or health not in (Health.EXCLUDED, Health.PROBATION):
                continue
            waited_ns = reactions.now_ns - int(reactions.reaction["since_ns"][number])
            if waited_ns < self._retry_ns(reactions, number):
                self._schedule(reactions, number)
            elif health == Health.PROBATION:
                reactions.clear(number)
            else:
                reactions.readmit(number)
                reactions.write("health", Health.PROBATION, number)
                self._schedule(reactions, number)
