"""One grammar of faults: `SENSOR[.CHANNEL].KIND[=SIZE]@START[+DURATION]`, in seconds and the sensor's units.

    ultrasonic.bias=0.5@10+5        0.5 m too much from 10 s to 15 s
    gps.1.drift=0.02@30             its second number runs away by 0.02 a second, to the end
    imu.broken@12.5                 no data from 12.5 s on

START counts from the first reading of the run (live: from the start of whoever lies), on the readings' own clock.
CHANNEL counts from 0; without it the fault is in every measured channel. No DURATION: to the end, a spike: one reading.
What each kind does stands in `faults_effects`, how several are put together in `faults_injection`.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from decimal import Decimal
from enum import StrEnum

from fusiond.errors import ConfigError
from fusiond.types import NANOSECONDS


class Kind(StrEnum):
    """How a sensor may lie, in the order in which several lies of one sensor act."""

    DELAY = "delay"
    SCALE = "scale"
    BIAS = "bias"
    DRIFT = "drift"
    NOISE = "noise"
    SPIKE = "spike"
    STUCK = "stuck"
    NAN = "nan"
    INTERMITTENT = "intermittent"
    BROKEN = "broken"


ORDER = {kind: place for place, kind in enumerate(Kind)}
SIZES: dict[Kind, tuple[str, float, float]] = {
    Kind.DELAY: ("seconds", 0.0, 1e6),
    Kind.SCALE: ("a factor", -math.inf, math.inf),
    Kind.BIAS: ("the sensor's units", -math.inf, math.inf),
    Kind.DRIFT: ("the sensor's units per second", -math.inf, math.inf),
    Kind.NOISE: ("times its own noise", 1.0, math.inf),
    Kind.SPIKE: ("the sensor's units", -math.inf, math.inf),
    Kind.INTERMITTENT: ("the share that is delivered", 0.0, 1.0),
}
"""What SIZE means, and its limits. A kind that is not here takes none."""
IDENTITY = {kind: 1.0 if kind in {Kind.SCALE, Kind.NOISE, Kind.INTERMITTENT} else 0.0 for kind in SIZES}
"""The size at which a fault is none: its readings keep their bits."""
WHOLE = frozenset({Kind.INTERMITTENT, Kind.BROKEN})
"""A reading is delivered whole or not at all: these take no CHANNEL."""

FORM = "SENSOR[.CHANNEL].KIND[=SIZE]@START[+DURATION]"
LONGEST_NS = 10**18
"""Some thirty years: START plus DURATION stays within 64 bits behind any stamp of this century."""
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d{1,3})?", re.IGNORECASE)
_TIME = re.compile(r"\d{1,12}(\.\d*)?|\.\d+")


@dataclass(frozen=True, slots=True)
class Fault:
    """One lie of one sensor; `str` gives its canonical text, which parses back to an equal one.

    Args:
        channel: None for every measured one.      size: in the units of SIZES, 0 where the kind takes none.
        start_ns: after the first reading of the run.      duration_ns: None to the end, for a spike one reading.
    """

    sensor: str
    kind: Kind
    start_ns: int
    size: float = 0.0
    channel: int | None = None
    duration_ns: int | None = None

    @property
    def harmless(self) -> bool:
        """Whether its size makes it no fault at all."""
        return self.kind in IDENTITY and self.size == IDENTITY[self.kind]

    @property
    def end_ns(self) -> int:
        """First moment after it, counted as START is."""
        return LONGEST_NS * 2 if self.duration_ns is None else self.start_ns + self.duration_ns

    def __str__(self) -> str:
        channel = "" if self.channel is None else f".{self.channel}"
        size = f"={_number_text(self.size)}" if self.kind in SIZES else ""
        duration = "" if self.duration_ns is None else f"+{_seconds_text(self.duration_ns)}"
        return f"{self.sensor}{channel}.{self.kind}{size}@{_seconds_text(self.start_ns)}{duration}"


def parse_fault(text: str) -> Fault:
    """The fault a text specifies. Raises: ConfigError."""
    subject = f"inject {text}"
    what, at, when = text.strip().partition("@")
    if not at:
        raise ConfigError(f"{subject}: has no @START; write {FORM}, START in seconds")
    start, plus, duration = when.partition("+")
    name, equals, size = what.partition("=")
    parts = name.split(".")
    if len(parts) not in (2, 3) or not all(parts) or re.search(r"\s", name):
        raise ConfigError(f"{subject}: `{name}` is no SENSOR.KIND or SENSOR.CHANNEL.KIND; write {FORM}")
    kind = _kind(parts[-1], subject)
    duration_ns = _time_ns(duration, "DURATION", subject) if plus else None
    if duration_ns == 0:
        raise ConfigError(f"{subject}: DURATION is 0 s (limit above 0); give its length or leave it out")
    return Fault(
        sensor=parts[0],
        kind=kind,
        start_ns=_time_ns(start, "START", subject),
        size=_size(kind, size if equals else None, parts[0], subject),
        channel=_channel(parts[1], kind, subject) if len(parts) == 3 else None,
        duration_ns=duration_ns,
    )


def parse_faults(texts: Iterable[str]) -> tuple[Fault, ...]:
    """Several. Raises: ConfigError for the first that is none."""
    return tuple(parse_fault(text) for text in texts)


def near(word: str, known: Iterable[str]) -> str:
    """`did you mean ...?` for a misspelt word, or what there is to choose from."""
    choices = sorted(known)
    found = difflib.get_close_matches(word, choices, 1, 0.6)
    if found:
        return f"did you mean `{found[0]}`?"
    return f"choose from {', '.join(choices)}" if choices else "there is none to name"


def _kind(word: str, subject: str) -> Kind:
    try:
        return Kind(word)
    except ValueError:
        raise ConfigError(f"{subject}: no fault is called `{word}`; {near(word, Kind)}") from None


def _channel(word: str, kind: Kind, subject: str) -> int:
    if not (word.isascii() and word.isdigit() and len(word) < 5):
        raise ConfigError(f"{subject}: CHANNEL `{word}` is no number; channels count from 0")
    if kind in WHOLE:
        raise ConfigError(
            f"{subject}: a reading comes whole or not at all; leave the channel `.{word}` out of {kind}"
        )
    return int(word)


def _size(kind: Kind, text: str | None, sensor: str, subject: str) -> float:
    if kind not in SIZES:
        if text is not None:
            raise ConfigError(f"{subject}: {kind} takes no size; leave `={text}` out")
        return 0.0
    unit, least, most = SIZES[kind]
    if text is None:
        raise ConfigError(f"{subject}: {kind} needs a size, {unit}; write {sensor}.{kind}=SIZE@START")
    size = float(text) if _NUMBER.fullmatch(text) else math.nan
    if not math.isfinite(size):
        raise ConfigError(f"{subject}: the size `{text}` is no finite number; give {unit}")
    if not least <= size <= most:
        limits = f"{least:g} or more" if most == math.inf else f"{least:g} to {most:g}"
        raise ConfigError(
            f"{subject}: {kind} is {unit}, {size:g} is outside (limits {limits}); choose another"
        )
    return size


def _time_ns(text: str, what: str, subject: str) -> int:
    if not _TIME.fullmatch(text):
        raise ConfigError(
            f"{subject}: {what} `{text}` is no number of seconds from 0 up; write e.g. @10 or @2.5+5"
        )
    exact_ns = Decimal(text) * NANOSECONDS
    if exact_ns != int(exact_ns):
        raise ConfigError(
            f"{subject}: {what} `{text}` is finer than a nanosecond; nine decimals are the most"
        )
    if exact_ns > LONGEST_NS:
        raise ConfigError(
            f"{subject}: {what} {text} s is too long (limit {LONGEST_NS // NANOSECONDS} s); shorten it"
        )
    return int(exact_ns)


def _number_text(value: float) -> str:
    return repr(value).removesuffix(".0")


def _seconds_text(t_ns: int) -> str:
    whole, rest = divmod(t_ns, NANOSECONDS)
    return f"{whole}.{rest:09d}".rstrip("0").rstrip(".")
