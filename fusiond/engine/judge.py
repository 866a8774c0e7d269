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
| faulty | errs on though its error is taken off; the rest sees every state | excluded | as above |
| any | frozen, or nothing that could be used | excluded | does without it, whatever is left |
| faulty | the error has gone, or its noise has fallen however slowly | healthy | believes the readings as they are |
| excluded | it agrees with the estimate, or lives where that is too unsure to say | probation | does without it |
| excluded | frozen, though known by another error | excluded | goes on without it; it is called stuck |
| excluded input | it has waited, and reads nearer to its stand-in than to its error | probation | tries it |
| probation (input) | it may be it, as one of several | excluded | does without it again |
| probation | they agree once more, and it has waited | healthy | uses it again |

Where no sensor explains the innovations the model is blamed, and no sensor is touched. Whoever falls ill again waits
twice as long to return. A decision reaches all snapshots, so that a late reading cannot undo it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.bad_samples import is_bad_sample, is_one_reading, until_next
from fusiond.engine.correction import LASTING, end_correction, lift_correction
from fusiond.engine.layout import Layout
from fusiond.engine.reactions import Reactions
from fusiond.engine.refine import is_watched, lead_of_another, refine_one, watch
from fusiond.engine.returning import QUIET, heal, retry, schedule, watch_noise
from fusiond.engine.revising import end_gone, is_corrected, take_off
from fusiond.faults.course import Suspect
from fusiond.faults.forecast import worst_error
from fusiond.faults.glr import Fit
from fusiond.faults.ground import burst_of
from fusiond.faults.hypotheses import Hypothesis
from fusiond.faults.identification import Identity
from fusiond.faults.isolation import Finding, Outcome, Twins, isolate
from fusiond.faults.response import respond
from fusiond.faults.tolerated import tolerate
from fusiond.types import Alarm, Health, Kind, Role

if TYPE_CHECKING:
    from fusiond.engine.engine import Engine

PATIENCE = 0.25
"""A case left open is reviewed when its readings have grown by this share."""
STEPS, LEAST = 128, 16
"""A window is worth looking at again after this part of it, a set that nothing tells apart after so many of those."""
CALM_WINDOWS = 16
"""Windows after which too little scatter is looked into again at the latest."""
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
                    heal(reactions, sensor, self.hypotheses)
                case Alarm.RETRY:
                    retry(reactions, self.hypotheses)
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
        reactions.open()
        finding = found or self._finding(reactions)
        if finding.outcome is not Outcome.MODEL and not self._matters(reactions, finding):
            reactions.close()
            return
        age = entries - int(desk["case_at"])
        undecided = finding.outcome is Outcome.UNDECIDED
        if finding.fit is not None and finding.fit.kind is not Kind.NOISE:
            reactions.freeze(finding.sensors)
        if is_one_reading(reactions, finding.fit) and age <= self.layout.shape.window // 2:
            desk["review_at"] = entries + (self._step if age > 0 else until_next(reactions, finding.fit))
        elif self._settled(reactions, finding):
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
        if set(fit.place) & (reactions.restless() | reactions.weighed_down()):
            return True
        excess = math.sqrt(max(float(fit.size[0]) ** 2 - 1.0, 0.0))
        members = [suspect for part in fit.hypothesis.parts for suspect in part]
        return any(
            excess * math.sqrt(reactions.noise_ratio(one.sensor)) * self.noise_std[one.sensor, one.channel]
            > self.tolerance.get(one, 0.0)
            for one in members
        )

    def _finding(self, reactions: Reactions) -> Finding:
        """What isolation says about the window now; who is out or silent has nothing to plead."""
        track = reactions.engine.track[0]
        age_ns = int(track["t_ns"]) - track["sensor_t_ns"]
        silent = {int(k) for k in np.flatnonzero((self.silence_ns > 0) & (age_ns > self.silence_ns))}
        out = reactions.out() | silent
        asked = [h for h in self.hypotheses if not set(h.place) & out]
        noisy = reactions.restless()
        covered = reactions.weighed_down() - noisy
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
                if not (is_watched(reactions, sensor) and refine_one(reactions, sensor, self.hypotheses)):
                    kept.append(sensor)
            elif spared:
                if is_corrected(reactions, sensor):
                    lift_correction(reactions, sensor, fit.onset)
                found = self._exclude(reactions, sensor, fit, kind)
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
        reactions.open()
        wait = max(LEAST * self._step, int(PATIENCE * (entries - int(desk["case_at"]))))
        desk["review_at"] = entries + min(wait, self.layout.shape.window)

    def _end_gone(self, reactions: Reactions, finding: Finding) -> bool:
        """Whether an error that is taken off has gone, which explains it all; an error of another kind has not."""
        return end_gone(reactions, finding, partial(lead_of_another, reactions, self.hypotheses))

    def _settled(self, reactions: Reactions, finding: Finding) -> bool:
        """Whether a bad sample, the end of an error taken off, or the return of one answers the alarm."""
        return (
            is_bad_sample(reactions, finding.fit)
            or self._end_gone(reactions, finding)
            or (finding.outcome is Outcome.UNDECIDED and self._relapsed(reactions, finding))
        )

    def _relapsed(self, reactions: Reactions, finding: Finding) -> bool:
        """Whether one of those who may be it is an input on trial: that was the question, and it is out again."""
        for fit in finding.standing:
            (sensor, *others) = fit.place
            on_trial = not others and reactions.reaction["health"][sensor] == Health.PROBATION
            if on_trial and self._excludable(reactions, sensor, fit.place):
                self._exclude(reactions, sensor, fit, fit.kind)
                reactions.replay()
                return True
        return False

    def _burst(self, reactions: Reactions, fit: Fit) -> None:
        """A spike of a sensor has been gated; one of an input is taken out, and a long one tells of its sensor."""
        if not fit.ground.is_input:
            return
        (sensor,) = fit.place
        number = fit.hypothesis.parts[0][0].channel
        entries = fit.ground.entries[burst_of(fit.ground, fit.hypothesis) == fit.number]
        readings = int(np.sum(fit.ground.response.odd_count[entries, number]))
        if (readings > SINGLE or len(entries) > 1) and self._excludable(reactions, sensor, fit.place):
            self._exclude(reactions, sensor, fit, Kind.SPIKE)
        else:
            reactions.leave_out(sensor, fit.onset, int(entries[-1]))
        reactions.replay()

    def _exclude(self, reactions: Reactions, sensor: int, fit: Fit, kind: Kind) -> Identity:
        """Name a sensor's fault, which began with the fit's onset, and exclude the sensor."""
        found = reactions.name(sensor, fit, kind, Health.EXCLUDED)
        self._send_out(reactions, sensor, fit.kind, fit.onset, reactions.sizes(sensor, fit))
        return found

    def _send_out(
        self, reactions: Reactions, sensor: int, kind: Kind, onset: int, sizes: Mapping[int, float], *,
        spared: bool = True,
    ) -> None:  # fmt: skip
        """Exclude a sensor whose fault began with an entry of the window.

        Args:
            sizes: of its error, by raw channel.   spared: see `Reactions.exclude`.
        """
        reactions.exclude(sensor, onset, spared=spared)
        reactions.expect(sensor, kind, sizes)
        if self.layout.sensors[sensor].role is Role.INPUT:
            schedule(reactions, sensor)

    def _weigh_down(self, reactions: Reactions, fit: Fit) -> None:
        """The sensor is noisier, or quieter again, than was thought: use the noise it has.

        Where the sensor's noise is estimated that is done already, and the monitors alone are told.
        """
        for sensor in fit.place:
            if is_corrected(reactions, sensor):
                end_correction(reactions, sensor, fit.onset)
            variance = float(fit.size[0]) ** 2 * reactions.noise_ratio(sensor)
            estimated = reactions.engine.adapts(sensor)
            if estimated:
                reactions.scale_noise(sensor, float(fit.size[0]) ** 2)
            if variance < QUIET:
                reactions.clear(sensor)
            elif variance > LARGEST_NOISE**2 and self._excludable(reactions, sensor, fit.place):
                self._exclude(reactions, sensor, fit, Kind.NOISE)
            else:
                reactions.name(sensor, fit, Kind.NOISE, Health.FAULTY)
                reactions.write("size", float(np.sqrt(variance)), sensor)
                if estimated:
                    watch_noise(reactions)
                else:
                    reactions.write("noise_excess", variance - 1.0, sensor)
        reactions.since(fit.onset)
        reactions.replay()

    def _unusable(self, reactions: Reactions, sensor: int, kind: Kind) -> None:
        """Its readings are frozen, or cannot be used at all; of one that is out it is known by then why it erred."""
        onset = reactions.run_began(sensor) if kind is Kind.STUCK else len(reactions.window)
        if sensor in reactions.out():
            if kind is Kind.STUCK and reactions.reaction["kind"][sensor] in LASTING:
                reactions.name_unusable(sensor, kind, onset)
                reactions.expect(sensor, kind, {})
            return
        reactions.close()
        if is_corrected(reactions, sensor):
            lift_correction(reactions, sensor, onset)
        reactions.name_unusable(sensor, kind, onset)
        # of a run that is older than the window nothing from before it is left to go on from
        spared = onset == 0 or self._spared(reactions, (sensor,))
        self._send_out(reactions, sensor, kind, onset, {}, spared=spared)
        reactions.replay()
