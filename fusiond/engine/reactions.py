"""What the estimator does about a fault: every decision written into the track and all its snapshots.

Exclusion. Where a leave-one-out filter exists that is not itself astray, it takes the place of all filters that heard
the sensor, in every snapshot, and the last readings are replayed without it, so that new leave-one-out filters have
settled and a second fault that began meanwhile is not in them. Without one, or where it knows too little as the sensor
cannot be spared, the readings since the onset are replayed without the sensor.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fusiond.engine.correction import LASTING, lift_correction, once_gone
from fusiond.faults.course import Suspect
from fusiond.faults.forecast import worst_error
from fusiond.faults.glr import Fit
from fusiond.faults.identification import Identity, identify
from fusiond.faults.isolation import Finding
from fusiond.faults.response import respond
from fusiond.faults.window import believed
from fusiond.numerics.kernel import interpreted
from fusiond.numerics.ud import ud_factor
from fusiond.types import NANOSECONDS, Alarm, Health, Kind, Role

if TYPE_CHECKING:
    from fusiond.engine.engine import Engine

SETTLED = 0.4
"""Share of the window, before the onset, from which leave-one-out filters are made anew after an exclusion."""
ASTRAY = 8
"""Readings in a row that a filter's gate has refused: it does not know where it is, and takes nobody's place."""
DOUBLINGS = 6
"""Relapses after which waiting grows no longer."""
OWN = ("x", "U", "d", "filter_t_ns")
"""Fields of the track that belong to one filter."""


class Reactions:
    """Decisions about one engine's sensors, and the replay they ask for.

    Args:
        noise_std: (s, m) declared deviations.
    """

    def __init__(self, engine: Engine, noise_std: NDArray[np.float64]) -> None:
        self.engine = engine
        self.window, self._places = believed(engine.window)
        self.now_ns = int(engine.track[0]["t_ns"])
        self.entries = int(engine.track[0]["monitor"]["entries"])
        self.reaction = engine.track[0]["reaction"]
        self.noise_std = noise_std
        self.layout = engine.layout
        self._since_ns: int | None = None
        self._widened: list[tuple[int, int, float]] = []
        self._doubted = False

    def noise(self, sensor: int) -> float:
        """The smallest declared deviation among the sensor's channels, in its unit."""
        used = self.noise_std[sensor][self.noise_std[sensor] > 0.0]
        return float(np.min(used, initial=np.inf)) if used.size else 0.0

    def out(self) -> set[int]:
        """Numbers of the sensors not used now."""
        reaction = self.reaction
        return {int(k) for k in np.flatnonzero((reaction["excluded"] != 0) & (reaction["until_ns"] == 0))}

    def weighed_down(self) -> frozenset[int]:
        """Sensors that count for less than their noise, as they are found noisy or as their set is covered."""
        return frozenset(int(k) for k in np.flatnonzero(self.reaction["noise_excess"] > 0.0))

    def restless(self) -> frozenset[int]:
        """Sensors thought noisier than declared, whose noise may become less: not those of a set that is covered."""
        noisy = frozenset(int(k) for k in np.flatnonzero(self.reaction["kind"] == Kind.NOISE))
        return noisy if self.adapts else noisy & self.weighed_down()

    def write(self, field: str, value: Any, sensor: int | None = None) -> None:
        """Write a decision into the track and all its snapshots."""
        for records in self.engine.histories:
            if sensor is None:
                records["reaction"][field] = value
            else:
                records["reaction"][field][:, sensor] = value

    def onset_ns(self, onset: int) -> int:
        """Stamp of an entry of the window; past its end, now."""
        return int(self.window["t_ns"][onset]) if onset < len(self.window) else self.now_ns

    def run_began(self, sensor: int) -> int:
        """Entry at which the sensor's run of equal values began."""
        mine = np.flatnonzero(self.window["sensor"] == sensor)
        run = int(self.engine.track[0]["monitor"]["run"][sensor])
        return int(mine[max(0, len(mine) - 1 - run)]) if len(mine) else len(self.window)

    def since(self, onset: int, *, settled: bool = False) -> None:
        """Have the readings since an entry replayed, or since some entries before it."""
        before = int(SETTLED * self.layout.shape.window)
        first = max(0, min(onset, len(self.window) - 1) - before) if settled else onset
        self.replay_from(self.onset_ns(first))

    def replay_from(self, t_ns: int) -> None:
        """Have the readings from a stamp on replayed."""
        self._since_ns = t_ns if self._since_ns is None else min(t_ns, self._since_ns)

    def widen_by(self, sensor: int, channel: int, std: float) -> None:
        """Have the estimate widened, once replayed, by the error that a bias of this deviation has caused."""
        self._widened.append((sensor, channel, std))

    def doubt_everything(self) -> None:
        """Have every filter widened, once replayed, by the covariance before the first reading."""
        self._doubted = True

    def replay(self) -> None:
        """Replay what was asked for; then widen the covariance where a correction is uncertain."""
        if self._since_ns is None:
            return
        self.engine.replay_since(self._since_ns)
        for sensor, channel, std in self._widened:
            self._widen(sensor, channel, std)
        if self._doubted:
            for row in range(len(self.layout.filters)):
                widen(self.engine, row, self.engine.initial_covariance())
        self._since_ns, self._widened, self._doubted = None, [], False
        # What an excluded sensor said before it was excluded is no plea for its return.
        monitor = self.engine.track[0]["monitor"]
        monitor["shadow"][list(self.out())] = 0.0
        if int(monitor["alarm"]) == Alarm.HEALED:
            monitor["alarm"] = Alarm.NONE

    def open(self) -> None:
        """A case is open, from the reading just applied on where none was."""
        desk = self.engine.desk[0]
        if desk["case_at"] == 0:
            desk["case_at"], desk["case_ns"] = self.entries, self.now_ns

    def close(self) -> None:
        """No case is open, nobody is suspected, the model is not blamed."""
        desk = self.engine.desk[0]
        desk["case_at"] = desk["review_at"] = 0
        self.write("model", 0)
        self.freeze(())
        for sensor in np.flatnonzero(self.reaction["health"] == Health.SUSPECT):
            self.clear(int(sensor))

    def clear(self, sensor: int) -> None:
        """The sensor is healthy: nothing is taken off it any more, and what was may have moved the estimate as far."""
        reaction = self.reaction
        if reaction["from_ns"][sensor, 1] and not reaction["to_ns"][sensor, 1]:
            own = np.flatnonzero(self.window["sensor"] == sensor)[-1:]
            left = once_gone(self.window[own], reaction, sensor)
            lift_correction(self, sensor, len(self.window))
            for channel in np.unique(np.nonzero(left)[1]):
                self._widen(sensor, int(channel), float(abs(left[0, channel])))
        for field in ("health", "kind", "size", "size_std", "suspects", "noise_excess"):
            self.write(field, 0, sensor)

    @property
    def adapts(self) -> bool:
        """Whether noise is estimated."""
        return self.layout.shape.adapt is not None

    def freeze(self, sensors: tuple[int, ...]) -> None:
        """What these sensors say, and no others, tells nothing of their noise: it may be the error that is sought."""
        if self.adapts:
            for records in self.engine.histories:
                records["noise"]["frozen"] = 0
                records["noise"]["frozen"][:, list(sensors)] = 1

    def recall_noise(self, sensors: tuple[int, ...], onset: int) -> None:
        """Take the noise of these sensors for what it was before the onset, as far as that is still known."""
        track, snapshots = self.engine.histories
        early = np.flatnonzero((snapshots["started"] != 0) & (snapshots["t_ns"] < self.onset_ns(onset)))
        if not self.adapts or not early.size:
            return
        before = snapshots[early[np.argmax(snapshots["t_ns"][early])]]["noise"]
        for field in ("trusted", "memory"):
            track["noise"][field][0][:, list(sensors)] = before[field][:, list(sensors)]
        for field in ("used", "slow", "slow_weight", "slow_mean"):
            track["noise"][field][0][list(sensors)] = before[field][list(sensors)]

    def noise_ratio(self, sensor: int) -> float:
        """Variance of the sensor's noise that the monitors reckon with, over the declared one."""
        ratio = 1.0 + float(self.reaction["noise_excess"][sensor])
        if self.adapts:
            ratio *= float(np.max(self.engine.track[0]["noise"]["slow"][sensor]))
        return ratio

    def scale_noise(self, sensor: int, factor: float) -> None:
        """From now on the monitors reckon with `factor` times the variance; the trusted R finds it for itself."""
        for records in self.engine.histories:
            records["noise"]["slow"][:, sensor] *= factor

    def suspect(self, sensors: tuple[int, ...]) -> None:
        """Those who may be it are suspect until the case is settled; who is known to be faulty stays so."""
        for sensor in sensors:
            if self.reaction["health"][sensor] == Health.HEALTHY:
                self.write("health", Health.SUSPECT, sensor)

    def name(self, sensor: int, fit: Fit, kind: Kind, health: Health) -> Identity:
        """Write what is wrong with the sensor: of several sizes the most significant."""
        found = identify(fit)
        mine = replace(found, parts=tuple(part for part in found.parts if sensor in part.sensors)).largest
        suspects = [one for part in fit.hypothesis.parts for one in part if one.sensor == sensor]
        own = [one for one in suspects if one.channel in mine.channels]
        channel = self.raw_channel(own[0]) if len(own) == 1 else -1
        self._say(sensor, health, kind, channel, mine.size, mine.std, found.onset_ns)
        return found

    def name_unusable(self, sensor: int, kind: Kind, onset: int) -> None:
        """Write that nothing the sensor says can be used."""
        self._say(sensor, Health.EXCLUDED, kind, -1, 0.0, 0.0, self.onset_ns(onset))

    def _say(
        self, sensor: int, health: Health, kind: Kind, channel: int, size: float, std: float, onset_ns: int
    ) -> None:
        said = {
            "health": health, "kind": kind, "channel": channel, "size": size, "size_std": std, "onset_ns": onset_ns,
            "since_ns": self.now_ns, "suspects": 0,
        }  # fmt: skip
        for field, value in said.items():
            self.write(field, value, sensor)

    def sizes(self, sensor: int, fit: Fit) -> dict[int, float]:
        """The fit's sizes of one sensor, by raw channel."""
        return {
            self.raw_channel(one): float(size)
            for size, part in zip(fit.size, fit.hypothesis.parts, strict=True)
            for one in part
            if one.sensor == sensor
        }

    def raw_channel(self, suspect: Suspect) -> int:
        """Raw channel of a suspect; an input's number becomes the channel that drives it."""
        if not suspect.is_input:
            return int(suspect.channel)
        slot = self.layout.inputs[suspect.channel].name
        return [channel.name for channel in self.layout.sensors[suspect.sensor].channels].index(slot)

    def cover(self, finding: Finding) -> None:
        """Say of every member of an ambiguous set what it would be, and weigh it down so far as to cover that error."""
        mask = sum(1 << sensor for sensor in finding.sensors)
        for fit in finding.standing:
            for sensor in fit.place:
                self.name(sensor, fit, fit.kind, Health.SUSPECT)
                self.write("suspects", mask & ~(1 << sensor), sensor)
                if self.layout.sensors[sensor].role is Role.UPDATE and fit.kind in LASTING:
                    self.write("noise_excess", self._covering(sensor, fit), sensor)

    def _covering(self, sensor: int, fit: Fit) -> float:
        """Factor less one by which the sensor's noise variance must grow to cover its error, where that is largest."""
        shares = [
            error / self.noise_std[sensor, one.channel]
            for one, error in worst_error(fit).items()
            if one.sensor == sensor and self.noise_std[sensor, one.channel] > 0.0
        ]
        return float(min(max(shares, default=0.0) ** 2, 1e6))

    def exclude(self, sensor: int, onset: int, *, spared: bool = True) -> None:
        """Stop using the sensor.

        Args:
            spared: whether the others see every state; else one that never had it knows less than was known before.
        """
        rows, name = self.layout.filters, self.layout.sensors[sensor].name
        refused = self.engine.track[0]["monitor"]["refused"].max(axis=1)
        clean = [
            k
            for k, row in enumerate(rows)
            if spared and row.hears == "without" and row.sensor == name and refused[k] < ASTRAY
        ]
        others = [k for k, row in enumerate(rows) if row.hears != "only" and k not in clean]
        self.write("excluded", 1, sensor)
        self.write("until_ns", 0, sensor)
        self.write("out_from_ns", 0 if clean else self._spoilt_from_ns(sensor, onset), sensor)
        self.write("noise_excess", 0.0, sensor)
        if clean:
            for records in self.engine.histories:
                for field in OWN:
                    records[field][:, others] = records[field][:, clean]
        self.since(onset if clean else max(0, onset - 1), settled=bool(clean))

    def _spoilt_from_ns(self, sensor: int, onset: int) -> int:
        """First stamp of a fault that shows from an entry on: an input spoils the interval before it."""
        if self.layout.sensors[sensor].role is Role.INPUT and onset > 0:
            return self.onset_ns(onset - 1) + 1
        return self.onset_ns(onset)

    def leave_out(self, sensor: int, onset: int, last: int) -> None:
        """Do without an input in the intervals before these entries alone."""
        self.write("excluded", 1, sensor)
        self.write("out_from_ns", self._spoilt_from_ns(sensor, onset), sensor)
        self.write("until_ns", self.onset_ns(last) + 1, sensor)
        self.since(max(0, onset - 1))

    def leave_out_until_now(self, sensor: int, from_ns: int) -> None:
        """Do without a sensor in the time since then alone."""
        for field, value in (("excluded", 1), ("out_from_ns", from_ns), ("until_ns", self.now_ns + 1)):
            self.write(field, value, sensor)

    def expect(self, sensor: int, kind: Kind, sizes: Mapping[int, float]) -> None:
        """What would still be a fault when the sensor asks to return: half a bias, scale or delay, by raw channel.

        Of a bias no less than one deviation of the noise; of another kind so many deviations.
        """
        noise = self.noise_std[sensor]
        blind = (4.0 if kind in (Kind.STUCK, Kind.GARBAGE) else 2.0) * noise
        shadow = {"shadow_size": blind, "shadow_gain": 0.0 * noise, "shadow_lag": 0.0 * noise}
        field = {Kind.SCALE: "shadow_gain", Kind.DELAY: "shadow_lag"}.get(kind, "shadow_size")
        if field != "shadow_size":
            shadow["shadow_size"] = 0.0 * noise
        for channel, size in sizes.items():
            if kind is Kind.BIAS:
                shadow[field][channel] = max(abs(size) / 2.0, noise[channel])
            elif field != "shadow_size":
                shadow[field][channel] = size / 2.0
        for name, value in shadow.items():
            self.write(name, value, sensor)

    def readmit(self, sensor: int) -> None:
        """Use the sensor's readings again from now on."""
        self.write("until_ns", self.now_ns + 1, sensor)
        self.write("relapses", int(self.reaction["relapses"][sensor]) + 1, sensor)

    def _widen(self, sensor: int, channel: int, std: float) -> None:
        """Add the uncertainty of a bias to the primary filter and the levels it is made of.

        P + g g' std^2, g the error that such a bias has caused.
        """
        response = respond(believed(self.engine.window)[0], 0)
        columns = np.unique(response.raw[response.sensor == sensor, channel])
        g = response.carried[:, columns].sum(axis=1) * std
        for row, filtered in enumerate(self.layout.filters):
            if filtered.hears in ("all", "level"):
                widen(self.engine, row, np.outer(g, g))


def doubled_ns(shortest_s: float, times: int) -> int:
    """A wait that doubles with every relapse; `times` from 0."""
    return int(shortest_s * 2.0 ** min(times, DOUBLINGS) * NANOSECONDS)


def widen(engine: Engine, row: int, more: NDArray[np.float64]) -> None:
    """Add (n, n) to the covariance of one filter, with what is pending of it; as it was where that has no factors.

    Law: tests/laws/test_covariance_rate.py::test_a_widened_covariance_is_that_of_the_full_rate.
    """
    P = engine.covariance(row) + more
    U, d = np.eye(len(P)), np.zeros(len(P))
    if interpreted(ud_factor)(P, U, d, 1e-9):
        engine.track[0]["U"][row], engine.track[0]["d"][row] = U, d
        if engine.layout.shape.lazy:
            engine.track[0]["pending"][row] = 0  # P holds what was pending
