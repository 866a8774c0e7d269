"""The grammar of faults: what is written is read, what is read is written again, what is wrong is named."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fusiond.errors import ConfigError
from fusiond.simulation.faults import IDENTITY, LONGEST_NS, SIZES, WHOLE, Fault, Kind, parse_fault
from fusiond.simulation.faults_injection import Injection, Measured

NAMES = st.from_regex(r"[a-z][a-z0-9_]{0,12}", fullmatch=True)
TIMES = st.integers(0, LONGEST_NS)


@st.composite
def faults(draw: st.DrawFn) -> Fault:
    kind = draw(st.sampled_from(Kind))
    size = 0.0
    if kind in SIZES:
        _, least, most = SIZES[kind]
        bounds = {"min_value": max(least, -1e300), "max_value": min(most, 1e300)}
        size = draw(st.floats(**bounds, allow_nan=False, allow_infinity=False))
    return Fault(
        sensor=draw(NAMES),
        kind=kind,
        start_ns=draw(TIMES),
        size=size,
        channel=None if kind in WHOLE else draw(st.none() | st.integers(0, 9999)),
        duration_ns=draw(st.none() | st.integers(1, LONGEST_NS)),
    )


@given(faults())
def test_what_is_written_is_read_back(fault):
    """Every fault equals what its own text says, to the nanosecond and the last bit of its size."""
    assert parse_fault(str(fault)) == fault
    assert str(parse_fault(str(fault))) == str(fault)


@given(st.text(max_size=40))
def test_any_other_text_is_the_operators_mistake(text):
    """Whatever is typed gives a fault or an error that quotes it, never anything else."""
    fault, said = None, ""
    try:
        fault = parse_fault(text)
    except ConfigError as error:
        said = str(error)
    assert parse_fault(str(fault)) == fault if fault else said.startswith(f"inject {text}: ")


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("ultrasonic.bias=0.5@10+5", Fault("ultrasonic", Kind.BIAS, 10**10, 0.5, None, 5 * 10**9)),
        ("gps.1.drift=-2e-2@.5", Fault("gps", Kind.DRIFT, 5 * 10**8, -0.02, 1)),
        ("imu.broken@0", Fault("imu", Kind.BROKEN, 0)),
        ("y1.intermittent=.1@2", Fault("y1", Kind.INTERMITTENT, 2 * 10**9, 0.1)),
        ("radar.delay=0.15@1.000000001", Fault("radar", Kind.DELAY, 1_000_000_001, 0.15)),
        (" noise.noise=4@3 ", Fault("noise", Kind.NOISE, 3 * 10**9, 4.0)),
    ],
)
def test_the_examples_mean_what_they_say(text, fault):
    assert parse_fault(text) == fault


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("u.bais=1@2", "no fault is called `bais`; did you mean `bias`?"),
        ("u.bias@1", "bias needs a size, the sensor's units; write u.bias=SIZE@START"),
        ("u.bias=1", "has no @START"),
        ("u.bias=1@", "START `` is no number of seconds"),
        ("u.bias=1@-1", "START `-1` is no number of seconds"),
        ("u.bias=1@1e3", "START `1e3` is no number of seconds"),
        ("u.bias=1@1+0", "DURATION is 0 s (limit above 0)"),
        ("u.bias=1@1+", "DURATION `` is no number of seconds"),
        ("u.bias=1@0.0000000001", "finer than a nanosecond"),
        ("u.bias=nan@1", "the size `nan` is no finite number"),
        ("u.bias=1e999@1", "the size `1e999` is no finite number"),
        ("u.stuck=2@1", "stuck takes no size; leave `=2` out"),
        ("u.noise=0.5@1", "0.5 is outside (limits 1 or more)"),
        ("u.intermittent=1.1@1", "1.1 is outside (limits 0 to 1)"),
        ("u.delay=-1@1", "-1 is outside"),
        ("u.0.broken@1", "leave the channel `.0` out of broken"),
        ("u.x.bias=1@1", "CHANNEL `x` is no number"),
        ("bias=1@1", "no SENSOR.KIND"),
        ("u.1.2.bias=1@1", "no SENSOR.KIND"),
    ],
)
def test_every_mistake_is_named(text, words):
    with pytest.raises(ConfigError) as raised:
        parse_fault(text)
    assert words in str(raised.value)


def test_what_is_not_there_is_named_with_what_is():
    sensors = [
        Measured("gps", 2, sigma=(0.5, 0.5), names=("x_m", "y_m")),
        Measured("applied", 1, sigma=(0.0,)),
    ]

    def mistake(text: str) -> str:
        with pytest.raises(ConfigError) as raised:
            Injection([parse_fault(text)], sensors)
        return str(raised.value)

    assert mistake("gsp.bias=1@1") == "inject gsp.bias=1@1: no sensor `gsp`; did you mean `gps`?"
    assert mistake("gps.2.bias=1@1") == "inject gps.2.bias=1@1: no channel 2; gps has 0 x_m, 1 y_m"
    assert "has no noise there to multiply" in mistake("applied.noise=2@1")
    with pytest.raises(ConfigError, match="the noise of mast is not known"):
        Injection([parse_fault("mast.noise=2@1")], [Measured("mast")])


def test_the_harmless_sizes_are_those_that_change_nothing():
    assert IDENTITY == {
        Kind.DELAY: 0.0, Kind.SCALE: 1.0, Kind.BIAS: 0.0, Kind.DRIFT: 0.0, Kind.NOISE: 1.0, Kind.SPIKE: 0.0,
        Kind.INTERMITTENT: 1.0,
    }  # fmt: skip
