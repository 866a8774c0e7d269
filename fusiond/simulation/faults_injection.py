"""Sensors that lie: every fault of a run, composed, seeded, and applied to readings as they pass.

    faults = parse_faults(["ultrasonic.bias=0.5@10+5"])
    injection = Injection(faults, [Measured("ultrasonic", 1, sigma=(0.01,))], seed=0)
    sent = injection.tell(readings)                          # readings of a simulated sensor
    z, keep = injection.of("ultrasonic").apply(t_ns, z)      # whole columns of a recording

Several faults of one sensor act in the order of `faults.Kind`, whatever the order they are given in: what is measured
(delay), how it becomes a number (scale, bias, drift, noise, spike), what the sensor makes of the number (stuck, nan),
and whether it is sent (intermittent, broken). `stuck` repeats the last value the sensor made, sent or not.

The same seed, faults and readings give the same bits, however the readings are cut into batches; each fault draws from
a stream of its own, so that one more or less changes no other. A fault whose size makes it none changes no bit.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fusiond.errors import ConfigError
from fusiond.simulation.faults import ORDER, Fault, Kind, near
from fusiond.simulation.faults_delay import DelayLine
from fusiond.simulation.faults_effects import Effect, Readings
from fusiond.simulation.streams import stream
from fusiond.simulation.tables import Floats, Reading, Times


@dataclass(frozen=True, slots=True)
class Measured:
    """What is known of an honest sensor.

    Args:
        channels: numbers a reading carries, None where nobody knows yet.
        measured: how many of them, leading, are measurements (an index follows them); None for all.
        sigma: standard deviation of each measured channel, None where nobody knows.
        angles: channels that live on a circle, rad.      names: of the channels, for messages.
    """

    name: str
    channels: int | None = None
    measured: int | None = None
    sigma: tuple[float, ...] | None = None
    angles: frozenset[int] = frozenset()
    names: tuple[str, ...] = ()


class SensorFaults:
    """The faults of one sensor and what they remember of its readings.

    Args:
        origin_ns: what START counts from, None for the stamp of the first reading.
        ready: faults may still be added; what they will need to remember is kept from now on.
    """

    def __init__(
        self,
        sensor: Measured,
        faults: Iterable[Fault],
        seed: int,
        origin_ns: int | None,
        *,
        ready: bool = False,
    ) -> None:
        self.sensor = sensor
        self.origin_ns = origin_ns
        self.faults: list[Fault] = []
        self._seed = seed
        self._ready = ready
        self._delays: list[Effect] = []
        self._in_value: list[Effect] = []
        self._in_sending: list[Effect] = []
        self._lines: dict[bytes, DelayLine] = {}
        self._newest: Floats | None = None
        self._drawn: dict[Kind, int] = {}
        for fault in faults:
            self.add(fault)

    def add(self, fault: Fault) -> None:
        """One more fault. Raises: ConfigError where it does not fit the sensor."""
        check_fault(fault, self.sensor)
        self.faults.append(fault)
        if self.origin_ns is not None:
            self._begin(fault)

    def clear(self, faults: Iterable[Fault] | None = None) -> None:
        """End some faults, all without a name; the next reading is free of them."""
        gone = list(self.faults if faults is None else faults)
        self.faults = [fault for fault in self.faults if fault not in gone]
        for effects in (self._delays, self._in_value, self._in_sending):
            effects[:] = [effect for effect in effects if effect.fault not in gone]

    def start(self, origin_ns: int) -> None:
        """What START counts from, where it was not known."""
        if self.origin_ns is None:
            self.origin_ns = origin_ns
            for fault in self.faults:
                self._begin(fault)

    def apply(self, t_ns: Times, z: Floats, sigma: Floats | None = None) -> tuple[Floats, NDArray[np.bool_]]:
        """What the sensor sends instead.

        Args:
            t_ns: (k,) stamps in order of arrival.      z: (k, m); left as it is.
            sigma: (k, m) standard deviations where the readings bring their own.
        Returns: (k, m) values, z itself where nothing meets them; (k,) whether each is sent.
        """
        keep = np.ones(len(t_ns), np.bool_)
        if not len(t_ns):
            return z, keep
        self.start(int(t_ns[0]))
        out = self._delayed(t_ns, z)
        if self._in_value or self._in_sending:
            out = out.copy() if out is z else out
        readings = Readings(t_ns, out, self._deviations(z.shape[1]) if sigma is None else sigma, keep)
        for effect in self._in_value:
            effect.apply(readings)
        if self._ready:
            self._newest = out[-1].copy()
        for effect in self._in_sending:
            effect.apply(readings)
        return out, keep

    def unmet(self) -> list[Fault]:
        """The faults that have met no reading so far; one whose size makes it none never does."""
        every = (*self._delays, *self._in_value, *self._in_sending)
        met = [effect.fault for effect in every if effect.hits]
        return [fault for fault in self.faults if not fault.harmless and fault not in met]

    def learn(self, channels: int, sigma: tuple[float, ...] | None = None) -> None:
        """What the readings tell of a sensor of which nobody said it."""
        known = self.sensor
        channels = channels if known.channels is None else known.channels
        self.sensor = replace(known, channels=channels, sigma=known.sigma or sigma)

    def _begin(self, fault: Fault) -> None:
        assert self.origin_ns is not None
        number = self._drawn.get(fault.kind, 0)
        self._drawn[fault.kind] = number + 1
        if fault.harmless:
            return
        channels = slice(None) if fault.channel is None else slice(fault.channel, fault.channel + 1)
        if fault.channel is None and fault.kind not in {Kind.STUCK, Kind.DELAY}:
            channels = slice(self.sensor.measured)
        rng = stream(self._seed, f"fault/{fault.sensor}/{fault.kind}/{number}")
        begin_ns, end_ns = self.origin_ns + fault.start_ns, self.origin_ns + fault.end_ns
        effect = Effect(fault, begin_ns, end_ns, channels, self.sensor.angles, rng, before=self._newest)
        effects = self._delays
        if fault.kind is not Kind.DELAY:
            effects = self._in_value if ORDER[fault.kind] < ORDER[Kind.STUCK] else self._in_sending
        effects.append(effect)
        effects.sort(key=lambda one: ORDER[one.fault.kind])
        for line in self._lines.values():
            line.keep(self._longest_ns())

    def _longest_ns(self) -> int:
        return sum(_delay_ns(effect.fault) for effect in self._delays)

    def _delayed(self, t_ns: Times, z: Floats) -> Floats:
        """The values of a while ago, where a delay meets them."""
        if not (self._delays or self._ready):
            return z
        late_ns = np.zeros(z.shape, np.int64)
        for effect in self._delays:
            rows = effect.rows(t_ns)
            late_ns[rows[:, np.newaxis], np.arange(z.shape[1])[effect.channels]] += _delay_ns(effect.fault)
        measured = self.sensor.measured
        if measured is None or measured >= z.shape[1]:
            return self._line(b"").feed(t_ns, z, late_ns)
        # What another beacon measured is no earlier value of this one.
        out = z.copy()
        indices = [row.tobytes() for row in np.ascontiguousarray(z[:, measured:])]
        for index in dict.fromkeys(indices):
            rows = np.flatnonzero([one == index for one in indices])
            out[rows] = self._line(index).feed(t_ns[rows], z[rows], late_ns[rows])
        return out

    def _line(self, index: bytes) -> DelayLine:
        line = self._lines.get(index)
        if line is None:
            line = self._lines[index] = DelayLine(self._longest_ns(), self.sensor.angles)
        return line

    def _deviations(self, width: int) -> Floats:
        """(m,) configured standard deviations, 0 for an index."""
        out = np.zeros(width)
        known = (self.sensor.sigma or ())[:width]
        out[: len(known)] = known
        return out


class Injection:
    """All faults of one run.

    Args:
        sensors: every sensor there is, honest ones too.      origin_ns: what START counts from; None for the stamp of
            the first reading of any sensor (`start`).
    Raises: ConfigError where a fault names a sensor or a channel that is not there, or noise where there is none.
    """

    def __init__(
        self,
        faults: Sequence[Fault],
        sensors: Iterable[Measured],
        seed: int = 0,
        origin_ns: int | None = None,
    ) -> None:
        known = {sensor.name: sensor for sensor in sensors}
        self.faults = tuple(faults)
        self._started = origin_ns is not None
        self._by_sensor: dict[str, SensorFaults] = {}
        for fault in faults:
            if fault.sensor not in known:
                raise ConfigError(f"inject {fault}: no sensor `{fault.sensor}`; {near(fault.sensor, known)}")
            lying = self._by_sensor.get(fault.sensor)
            if lying is None:
                lying = SensorFaults(known[fault.sensor], (), seed, origin_ns)
                self._by_sensor[fault.sensor] = lying
            lying.add(fault)

    def unmet(self) -> list[Fault]:
        """The faults that have met no reading so far."""
        return [fault for lying in self._by_sensor.values() for fault in lying.unmet()]

    def of(self, sensor: str) -> SensorFaults | None:
        """The faults of one sensor, None where it is honest."""
        return self._by_sensor.get(sensor)

    def start(self, origin_ns: int) -> None:
        """What START counts from, the first time it is told."""
        if not self._started:
            self._started = True
            for lying in self._by_sensor.values():
                lying.start(origin_ns)

    def tell(self, readings: Iterable[Reading]) -> list[Reading]:
        """What simulated sensors send instead of these readings, in their order."""
        return [sent for reading in readings if (sent := self._tell(reading)) is not None]

    def _tell(self, reading: Reading) -> Reading | None:
        self.start(reading.t_ns)
        lying = self._by_sensor.get(reading.sensor)
        if lying is None:
            return reading
        z, keep = lying.apply(np.array([reading.t_ns]), np.array([reading.z]))
        return Reading(reading.t_ns, reading.sensor, tuple(z[0].tolist())) if keep[0] else None


def check_fault(fault: Fault, sensor: Measured) -> None:
    """Whether a fault fits its sensor. Raises: ConfigError."""
    count, channel = sensor.channels, fault.channel
    if count is not None and channel is not None and channel >= count:
        numbers = sensor.names or ("",) * count
        named = ", ".join(f"{k} {name}".strip() for k, name in enumerate(numbers))
        raise ConfigError(f"inject {fault}: no channel {channel}; {sensor.name} has {named}")
    if fault.kind is not Kind.NOISE or fault.harmless:
        return
    if sensor.sigma is None:
        raise ConfigError(
            f"inject {fault}: the noise of {sensor.name} is not known, and {fault.size:g} times of what it would be; "
            f"give its configuration or its standard deviation"
        )
    of_channel = sensor.sigma if channel is None else sensor.sigma[channel : channel + 1]
    if not any(of_channel):
        raise ConfigError(
            f"inject {fault}: {sensor.name} has no noise there to multiply (sigma 0); use bias, drift or spike"
        )


def _delay_ns(fault: Fault) -> int:
    return round(fault.size * 1e9)
