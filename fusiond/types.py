"""The nouns every room shares: slots with units, roles, verdicts, health.

Enumerations that reach the compiled step are integers; `.label` is the word an operator reads.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

NANOSECONDS = 1_000_000_000
"""Nanoseconds in a second: every time below the wire is an integer number of nanoseconds."""


@dataclass(frozen=True, slots=True)
class Slot:
    """One named number with its unit: a state, an input, or a channel of a reading.

    Args:
        name: lower-case word, e.g. `velocity`.
        unit: unit as it stands in a key, e.g. `m`, `m_s`, `rad_s`; empty where the number has none.
    """

    name: str
    unit: str = ""

    @property
    def key(self) -> str:
        """Name with unit, as configurations spell it: `velocity_m_s`."""
        return f"{self.name}_{self.unit}" if self.unit else self.name


class Label(IntEnum):
    """An integer for the kernels with a word for people."""

    @property
    def label(self) -> str:
        """The lower-case word used in JSON and messages."""
        return self.name.lower()


class Role(Label):
    """What the readings of a sensor do to the estimate."""

    UPDATE = 0
    """condition the state"""
    INPUT = 1
    """drive the prediction"""
    REFERENCE = 2
    """tell the controller where to go"""
    APPLIED = 3
    """acknowledge what the actuator did; drives nothing unless configured as an input"""


class Hold(Label):
    """Which interval a reading of an input describes."""

    NEXT = 0
    """from its stamp until the next reading (zero-order hold)"""
    PREVIOUS = 1
    """the interval that ends at its stamp (a sampled accelerometer, a wheel speed over the last period)"""


class Verdict(Label):
    """What became of one reading. Every refusal has a name; none is an exception."""

    USED = 0
    """conditioned the state, drove the prediction, or reached the controller"""
    NON_FINITE = 1
    WRONG_LENGTH = 2
    OUT_OF_RANGE = 3
    BAD_COVARIANCE = 4
    """its own R is not symmetric positive semi-definite"""
    UNKNOWN_INDEX = 5
    """the index it carries (a beacon's number) is not in the configuration"""
    DUPLICATE = 6
    TOO_LATE = 7
    """older than the newest reading by more than the horizon"""
    FROM_FUTURE = 8
    """stamped further ahead than the configured limit"""
    HELD = 9
    """repeats the value of a sensor that holds its last value between fixes: no fresh evidence"""
    GATED = 10
    """further from the prediction than noise explains: not used, but weighed as evidence of a fault"""
    EXCLUDED = 11
    """its sensor is thought faulty: not used, but watched for its return"""
    CONFLICT = 12
    """its sequence number came before with another value: two publishers share the key"""
    UNKNOWN_SENSOR = 20
    BAD_CRC = 21
    MALFORMED = 22


class Health(Label):
    """Health of one sensor."""

    HEALTHY = 0
    SUSPECT = 1
    FAULTY = 2
    EXCLUDED = 3
    PROBATION = 4
    SILENT = 5


class ServiceHealth(Label):
    """Health of the whole estimate."""

    NOMINAL = 0
    DEGRADED = 1
    """some sensor is silent or not used; the rest still corrects the state"""
    DEAD_RECKONING = 2
    """nothing has corrected the state for a while"""
    INVALID = 3
    """nothing has corrected it for too long, or it is not finite"""


class Action(Label):
    """What the engine did beyond filtering one reading."""

    NONE = 0
    REPLAYED = 1
    """the reading was late: rolled back, inserted, replayed"""
    RETIMED = 2
    """the time base jumped: the state was carried over to the new one"""
    RESET = 3
    """the state was set to its initial value: on command, or because time jumped with no clock to measure by"""


TICK = -1
"""Sensor number of a tick: time passing is an event like a reading."""
RESET = -2
"""Sensor number of an operator's reset: an event too, so that a replay resets where the run did."""
EVENTS = {TICK: "tick", RESET: "reset"}
"""What is no sensor's reading, and what a log calls it."""


def seconds(t_ns: int) -> float:
    """Seconds, as float, of an integer number of nanoseconds."""
    return t_ns / NANOSECONDS


def nanoseconds(t_s: float) -> int:
    """Nearest integer number of nanoseconds of a time in seconds."""
    return round(t_s * NANOSECONDS)


class Alarm(Label):
    """Which test asks for judgement."""

    NONE = 0
    CELL = 1
    """a cell of the bank: some fault's signature is in the innovations"""
    VARIANCE = 2
    POOLED = 3
    WHITENESS = 4
    FROZEN = 5
    GARBAGE = 6
    """readings that cannot be used keep coming"""
    HEALED = 7
    """an excluded sensor agrees with the estimate again"""
    REVIEW = 8
    """more readings have come for a case that was left open"""
    RETRY = 9
    """an excluded input has waited long enough to be tried again, or a kind left open to be weighed again"""


class Kind(Label):
    """What is wrong with a sensor; a size stands beside it."""

    NONE = 0
    BIAS = 1
    DRIFT = 2
    STUCK = 3
    SILENT = 4
    NOISE = 5
    SPIKE = 6
    SCALE = 7
    DELAY = 8
    GARBAGE = 9
