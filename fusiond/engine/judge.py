"""The judge of alarms: who is wrong, what is done about it, and when a sensor is taken back.

Theory of operation. The compiled step only raises alarms; it stops with the reading that raised one, and the judge
decides before the next is looked at. Health of a sensor, and what moves it:

| from | on | to | and the estimator |
|---|---|---|---|
| healthy | an alarm that isolation cannot settle yet | suspect | goes on; the case is reviewed as readings come |
| healthy, suspect | isolated; the rest sees every state | excluded | becomes the filter that never had the sensor |
| healthy, suspect | isolated; the rest does not | faulty | takes the error off every reading since the onset |
| healthy, suspect | isolated; noise | faulty | weighs the readings by the noise they have |
| healthy | one of a set that nothing tells apart | suspect | weighs the whole set down so as to cover all |
| faulty | the error has gone | healthy | believes the readings as they are |
| excluded | its readings agree with the estimate | probation | still does without it |
| probation | they agree once more, and it has waited | healthy | uses it again |

Where no sensor explains the innovations the model is blamed, and no sensor is touched. Whoever falls ill again waits
twice as long in probation. A decision reaches all snapshots, so that a late reading cannot undo it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.layout import Layout
from fusiond.faults.glr import Fit
from fusiond.faults.hypotheses import Hypothesis
from fusiond.faults.isolation import Finding, Outcome, isolate
from fusiond.faults.response import respond
from fusiond.types import NANOSECONDS, Alarm, Health, Kind, Role

if TYPE_CHECKING:
    from fusiond.engine.engine import Engine

SETTLED = 50
"""Entries before the onset from which leave-one-out filters are made anew after an exclusion."""
PATIENCE = 0.25
"""A case left open is reviewed when its readings have grown by this share."""
PROBATION_S = 1.0
"""Shortest probation; doubled with every relapse, up to RELAPSES times."""
RELAPSES = 6
SURE = 3.0
"""Standard deviations within which a remaining error is none."""
LASTING = (Kind.BIAS, Kind.DRIFT, Kind.SCALE)
"""Errors that can be taken off a reading."""


@dataclass(frozen=True, slots=True)
class Judge:
    """Decides about alarms; whatever it decides it writes into the engine's records.

    Args:
        hypotheses: all explanations tried.   enough: whether every state is still seen without these sensors.
        noise_std: (s, m) declared deviations.   policy: of each sensor, auto, exclude or compensate.
        replaceable: whether an input has something to fall back on.
    """

    layout: Layout
    hypotheses: tuple[Hypothesis, ...]
    enough: Callable[[frozenset[int]], bool]
    noise_std: NDArray[np.float64]
    policy: tuple[str, ...]
    replaceable: tuple[bool, ...]

    def consider(self, engine: Engine) -> None:
        """Decide about the alarm raised by the reading just applied, and about those that its decision raises."""
        for _ in range(len(self.layout.sensors) + 1):
            monitor = engine.track[0]["monitor"]
            alarm, sensor = Alarm(int(monitor["alarm"])), int(monitor["alarm_sensor"])
            monitor["alarm"] = Alarm.NONE
            match alarm:
                case Alarm.NONE:
                    return
                case Alarm.FROZEN | Alarm.GARBAGE:
                    kind = Kind.STUCK if alarm is Alarm.FROZEN else Kind.GARBAGE
                    self._unusable(engine, sensor, kind)
                case Alarm.HEALED:
                    self._healed(engine, sensor)
                case _:
                    self._weigh(engine, alarm)

    def _weigh(self, engine: Engine, alarm: Alarm) -> None:
        """Ask isolation, and do what follows from its answer; alarms within an open case wait for its review."""
        desk, entries = engine.desk[0], int(engine.track[0]["monitor"]["entries"])
        if alarm is not Alarm.REVIEW and entries < desk["review_at"]:
            return
        if desk["case_at"] == 0:
            desk["case_at"] = entries
        finding = self._finding(engine)
        age = entries - int(desk["case_at"])
        overdue = age > self.layout.shape.window // 2
        if finding.outcome is Outcome.NOTHING or (finding.outcome is Outcome.UNDECIDED and overdue):
            self._close(engine)
        elif finding.outcome is Outcome.UNDECIDED:
            desk["review_at"] = entries + max(1, int(PATIENCE * age))
            self._suspect(engine, finding)
        elif finding.outcome is Outcome.MODEL:
            self._write(engine, "model", 1)
            desk["review_at"] = entries + self.layout.shape.window
        elif finding.outcome is Outcome.AMBIGUOUS:
            self._cover(engine, finding)
        else:
            self._close(engine)
            self._react(engine, finding)

    def _finding(self, engine: Engine) -> Finding:
        """What isolation says about the window now; sensors not used have nothing to plead."""
        window = engine.window
        out = self._out(engine)
        asked = [h for h in self.hypotheses if not set(h.place) & out]
        return isolate(respond(window, self.layout.shape.inputs), asked)

    def _out(self, engine: Engine) -> set[int]:
        """Numbers of the sensors not used now."""
        reaction = engine.track[0]["reaction"]
        out = (reaction["excluded"] != 0) & (reaction["until_ns"] == 0)
        return {int(k) for k in np.flatnonzero(out)}

    def _records(self, engine: Engine) -> Iterable[NDArray[Any]]:
        """The track and every snapshot of it."""
        return engine.histories

    def _write(self, engine: Engine, field: str, value: Any, sensor: int | None = None) -> None:
        """Write a decision into the track and all its snapshots."""
        for records in self._records(engine):
            if sensor is None:
                records["reaction"][field] = value
            else:
                records["reaction"][field][:, sensor] = value

    def _close(self, engine: Engine) -> None:
        """No case is open, nobody is suspected, the model is not blamed."""
        desk, reaction = engine.desk[0], engine.track[0]["reaction"]
        desk["case_at"] = desk["review_at"] = 0
        self._write(engine, "model", 0)
        for sensor in np.flatnonzero(reaction["health"] == Health.SUSPECT):
            self._clear(engine, int(sensor))

    def _clear(self, engine: Engine, sensor: int) -> None:
        """The sensor is healthy, and its readings are believed as they are from now on."""
        names = (
            "health",
            "kind",
            "size",
            "size_std",
            "suspects",
            "noise_excess",
            "from_ns",
            "offset",
            "drift",
            "gain_error",
        )
        for field in names:
            self._write(engine, field, 0, sensor)

    def _suspect(self, engine: Engine, finding: Finding) -> None:
        """Those who may be it are suspect until the case is settled; who is known to be faulty stays so."""
        for sensor in finding.sensors:
            if engine.track[0]["reaction"]["health"][sensor] == Health.HEALTHY:
                self._write(engine, "health", Health.SUSPECT, sensor)

    def _name(self, engine: Engine, sensor: int, fit: Fit, kind: Kind, health: Health) -> None:
        """Write what is wrong with the sensor."""
        window = engine.window
        at = [k for k, part in enumerate(fit.hypothesis.parts) if any(s.sensor == sensor for s in part)]
        strength = [abs(fit.size[k]) / max(np.sqrt(fit.covariance[k, k]), 1e-300) for k in at]
        chosen = at[int(np.argmax(strength))]
        part = fit.hypothesis.parts[chosen]
        mine = [suspect for suspect in part if suspect.sensor == sensor]
        size = float(fit.size[chosen])
        said = {
            "health": health,
            "kind": kind,
            "channel": self._channel(mine) if len(mine) == 1 else -1,
            "size": 1.0 + size if kind is Kind.SCALE else size,
            "size_std": float(np.sqrt(fit.covariance[chosen, chosen])),
            "onset_ns": int(window["t_ns"][fit.onset]),
            "since_ns": int(engine.track[0]["t_ns"]),
            "suspects": 0,
        }
        for field, value in said.items():
            self._write(engine, field, value, sensor)

    def _channel(self, mine: list[Any]) -> int:
        """Raw channel of a suspect; an input's number becomes the channel that drives it."""
        suspect = mine[0]
        if not suspect.is_input:
            return int(suspect.channel)
        slot = self.layout.inputs[suspect.channel].name
        channels = [channel.name for channel in self.layout.sensors[suspect.sensor].channels]
        return channels.index(slot)

    def _cover(self, engine: Engine, finding: Finding) -> None:
        """Weigh every member of an ambiguous set down to what its error would have to be, and ask again later."""
        fit, desk = finding.fit, engine.desk[0]
        assert fit is not None
        mask = sum(1 << sensor for sensor in finding.sensors)
        for sensor in finding.sensors:
            if self.layout.sensors[sensor].role is not Role.UPDATE:
                continue
            self._write(engine, "health", Health.SUSPECT, sensor)
            self._write(engine, "kind", finding.choice.kind or fit.kind, sensor)
            self._write(engine, "size", float(np.max(np.abs(fit.size))), sensor)
            self._write(engine, "size_std", float(np.sqrt(np.max(np.diagonal(fit.covariance)))), sensor)
            self._write(engine, "onset_ns", int(engine.window["t_ns"][fit.onset]), sensor)
            self._write(engine, "suspects", mask & ~(1 << sensor), sensor)
            error = float(np.max(np.abs(fit.size))) if fit.kind is Kind.BIAS else 0.0
            noise = float(np.min(self.noise_std[sensor, : self._dof(sensor)]))
            self._write(
                engine, "noise_excess", min((error / noise) ** 2, 1e6) if noise > 0.0 else 0.0, sensor
            )
        desk["review_at"] = int(engine.track[0]["monitor"]["entries"]) + self.layout.shape.window

    def _dof(self, sensor: int) -> int:
        """Measured channels of a sensor."""
        return max(1, int(np.count_nonzero(self.noise_std[sensor])))

    def _react(self, engine: Engine, finding: Finding) -> None:
        """One sensor, or a group with one fault, is named: exclude it, or use it with its error taken off."""
        fit = finding.choice.fit or finding.fit
        assert fit is not None
        kind = finding.choice.kind
        onset_ns = int(engine.window["t_ns"][fit.onset])
        since_ns = self._settled_ns(engine, fit.onset)
        if kind is Kind.SPIKE:
            return
        if kind is Kind.NOISE:
            self._weigh_down(engine, fit)
            return
        if any(engine.track[0]["reaction"]["kind"][s] in LASTING for s in fit.place):
            self._revise(engine, fit, kind)
            return
        named = [(sensor, self._excludable(engine, sensor, fit.place)) for sensor in fit.place]
        for sensor, excludable in named:
            health = Health.EXCLUDED if excludable else Health.FAULTY
            self._name(engine, sensor, fit, kind, health)
        for sensor, excludable in named:
            if excludable:
                self._exclude(engine, sensor, np.abs(self._shift(fit, sensor)) / 2.0)
            else:
                self._take_off(engine, sensor, fit, kind, onset_ns)
        engine.replay_since(since_ns)

    def _settled_ns(self, engine: Engine, onset: int) -> int:
        """Stamp some entries before the onset."""
        return int(engine.window["t_ns"][max(0, onset - SETTLED)])

    def _excludable(self, engine: Engine, sensor: int, together: tuple[int, ...]) -> bool:
        """Whether the sensor, with all that are out or go out with it, can be done without."""
        if self.policy[sensor] == "compensate":
            return False
        if self.layout.sensors[sensor].role is Role.INPUT:
            return self.replaceable[sensor]
        updating = {s for s in {*self._out(engine), *together} if self.layout.sensors[s].role is Role.UPDATE}
        return self.enough(frozenset(updating))

    def _shift(self, fit: Fit, sensor: int) -> NDArray[np.float64]:
        """(m,) size of a lasting error by raw channel; where it is no bias, several deviations of the noise."""
        shift = np.where(self.noise_std[sensor] > 0.0, 4.0 * self.noise_std[sensor], 0.0)
        if fit.kind is Kind.BIAS and self.layout.sensors[sensor].role is Role.UPDATE:
            for size, part in zip(fit.size, fit.hypothesis.parts, strict=True):
                for suspect in part:
                    if suspect.sensor == sensor:
                        shift[suspect.channel] = max(
                            abs(float(size)), 2.0 * self.noise_std[sensor, suspect.channel]
                        )
        return shift

    def _exclude(self, engine: Engine, sensor: int, shadow: NDArray[np.float64]) -> None:
        """Stop using the sensor: where a filter never had it, that filter takes the place of all that did."""
        rows = self.layout.filters
        spare = [
            k
            for k, row in enumerate(rows)
            if row.hears == "without" and row.sensor == self.layout.sensors[sensor].name
        ]
        for records in self._records(engine):
            records["reaction"]["excluded"][:, sensor] = 1
            records["reaction"]["until_ns"][:, sensor] = 0
            records["reaction"]["shadow_size"][:, sensor] = shadow
            records["reaction"]["noise_excess"][:, sensor] = 0.0
            records["reaction"]["from_ns"][:, sensor] = 0
            records["monitor"]["shadow"][:, sensor] = 0.0
            for clean in spare:
                for k, row in enumerate(rows):
                    if row.hears != "only" and k != clean:
                        for field in ("x", "U", "d", "filter_t_ns"):
                            records[field][:, k] = records[field][:, clean]

    def _take_off(self, engine: Engine, sensor: int, fit: Fit, kind: Kind, onset_ns: int) -> None:
        """Take the error found off every reading since its onset."""
        if kind not in LASTING:
            return
        field = {Kind.BIAS: "offset", Kind.DRIFT: "drift", Kind.SCALE: "gain_error"}[kind]
        values = np.zeros(self.layout.shape.payload)
        for size, part in zip(fit.size, fit.hypothesis.parts, strict=True):
            for suspect in part:
                if suspect.sensor == sensor:
                    values[self._channel([suspect])] = size
        was = engine.track[0]["reaction"][field][sensor].copy()
        self._write(engine, field, was + values, sensor)
        self._write(engine, "from_ns", max(1, onset_ns), sensor)

    def _revise(self, engine: Engine, fit: Fit, kind: Kind) -> None:
        """A sensor used with its error taken off errs anew: it has healed, or the error is another one."""
        for sensor in fit.place:
            reaction = engine.track[0]["reaction"]
            onset_ns = int(engine.window["t_ns"][fit.onset])
            left = float(reaction["size"][sensor]) + float(fit.size[0])
            if reaction["kind"][sensor] == Kind.SCALE:
                left -= 1.0
            std = np.hypot(float(reaction["size_std"][sensor]), float(np.sqrt(fit.covariance[0, 0])))
            if kind is reaction["kind"][sensor] or kind is Kind.BIAS:
                healed = abs(left) < SURE * std + float(np.min(self.noise_std[sensor, : self._dof(sensor)]))
            else:
                healed = False
            since_ns = self._settled_ns(engine, fit.onset)
            if healed:
                self._clear(engine, sensor)
            else:
                self._name(engine, sensor, fit, kind, Health.FAULTY)
                self._take_off(engine, sensor, fit, kind, onset_ns)
            engine.replay_since(since_ns)

    def _weigh_down(self, engine: Engine, fit: Fit) -> None:
        """The sensor is noisier, or quieter again, than was thought: use the noise it has."""
        since_ns = self._settled_ns(engine, fit.onset)
        for sensor in fit.place:
            reaction = engine.track[0]["reaction"]
            factor = float(fit.size[0]) ** 2 * (1.0 + float(reaction["noise_excess"][sensor]))
            if factor < 1.5**2:
                self._clear(engine, sensor)
                continue
            self._name(engine, sensor, fit, Kind.NOISE, Health.FAULTY)
            self._write(engine, "size", float(np.sqrt(factor)), sensor)
            self._write(engine, "noise_excess", factor - 1.0, sensor)
        engine.replay_since(max(since_ns, int(engine.window["t_ns"][max(0, fit.onset)]) - 1))

    def _unusable(self, engine: Engine, sensor: int, kind: Kind) -> None:
        """Its readings are frozen, or cannot be used at all."""
        if sensor in self._out(engine):
            return
        track = engine.track[0]
        window = engine.window
        mine = np.flatnonzero(window["sensor"] == sensor)
        run = int(track["monitor"]["run"][sensor])
        onset = (
            int(mine[max(0, len(mine) - 1 - run)])
            if len(mine) and kind is Kind.STUCK
            else max(0, len(window) - 1)
        )
        since_ns = self._settled_ns(engine, onset) if len(window) else int(track["t_ns"])
        can_go = self._excludable(engine, sensor, (sensor,))
        said = {
            "health": Health.EXCLUDED if can_go else Health.FAULTY,
            "kind": kind,
            "channel": -1,
            "size": 0.0,
            "size_std": 0.0,
            "onset_ns": int(window["t_ns"][onset]) if len(window) else int(track["t_ns"]),
            "since_ns": int(track["t_ns"]),
            "suspects": 0,
        }
        for field, value in said.items():
            self._write(engine, field, value, sensor)
        if can_go:
            self._close(engine)
            self._exclude(engine, sensor, 4.0 * self.noise_std[sensor])
            engine.replay_since(since_ns)

    def _healed(self, engine: Engine, sensor: int) -> None:
        """An excluded sensor agrees with the estimate: first on probation, then, once it has waited, used again."""
        reaction, now_ns = engine.track[0]["reaction"], int(engine.track[0]["t_ns"])
        if reaction["health"][sensor] != Health.PROBATION:
            self._write(engine, "health", Health.PROBATION, sensor)
            self._write(engine, "since_ns", now_ns, sensor)
            return
        relapses = int(reaction["relapses"][sensor])
        wait_ns = int(PROBATION_S * 2.0**relapses * NANOSECONDS)
        if now_ns - int(reaction["since_ns"][sensor]) < wait_ns:
            return
        self._clear(engine, sensor)
        self._write(engine, "until_ns", now_ns + 1, sensor)
        self._write(engine, "relapses", min(relapses + 1, RELAPSES), sensor)
