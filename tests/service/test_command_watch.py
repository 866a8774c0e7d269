"""The watchdog of commands: the safe command when the loop is late, numbered and aged like every other."""

from __future__ import annotations

import json
from types import SimpleNamespace

import pytest

from fusiond.control.levels import Safe
from fusiond.service.command_output import CommandOutput, Fallback
from fusiond.service.command_watch import CommandWatch
from fusiond.service.lease import Lease
from fusiond.types import Slot

MS = 1_000_000
LAYOUT = SimpleNamespace(controls=(Slot("force", "n"),))


class Wire:
    """Stands for a Zenoh session and its one publisher."""

    def __init__(self):
        self.sent = []

    def declare_publisher(self, key, **_):
        return self

    def put(self, payload):
        self.sent.append(json.loads(payload))


class Stopped:
    """A clock that stands."""

    def now_ns(self):
        return 0


@pytest.fixture
def wire():
    return Wire()


def watched(wire, mode=Safe.ZERO, values=(0.25,), ramp_ns=100 * MS):
    output = CommandOutput(
        wire, LAYOUT, "x", lease=Lease(5), packed=False, fallback=Fallback(int(mode), values, ramp_ns)
    )
    return output, CommandWatch(output, 50 * MS, Stopped())


def test_before_the_first_command_nothing_is_late(wire):
    _, watch = watched(wire)
    assert not watch.look(10_000 * MS)
    assert wire.sent == []


def test_while_commands_come_the_watchdog_is_silent(wire):
    output, watch = watched(wire)
    for k in range(10):
        output.send(k * 40 * MS, (1.0,), True, 0.01, 0)
        assert not watch.look(k * 40 * MS)
    assert len(wire.sent) == 10


def test_a_late_loop_has_the_safe_command_sent_until_it_is_back(wire):
    """50 ms after the last command, then at every look; not valid, level safe, the next number, as old as it is."""
    output, watch = watched(wire)
    output.send(1000 * MS, (1.0,), True, 0.01, 0)
    assert not watch.look(1000 * MS)
    assert not watch.look(1050 * MS)
    assert watch.look(1051 * MS)
    assert watch.look(1064 * MS)
    output.send(1070 * MS, (0.5,), True, 0.01, 0)
    assert not watch.look(1071 * MS)
    seqs = [one["seq"] for one in wire.sent]
    assert seqs == [1, 2, 3, 4]
    late = wire.sent[1]
    assert (late["valid"], late["level"], late["u"]) == (False, "safe", {"force": 0.25})
    assert late["t_ns"] == 1051 * MS
    assert late["age_s"] == pytest.approx(0.061)
    assert (wire.sent[3]["level"], output.missed) == ("nominal", 2)


@pytest.mark.parametrize(("mode", "u"), [(Safe.HOLD, 1.0), (Safe.ZERO, 0.25), (Safe.RAMP, 1.0 - 0.75 * 0.6)])
def test_the_safe_command_is_the_configured_one(wire, mode, u):
    output, watch = watched(wire, mode)
    output.send(0, (1.0,), True, 0.0, 0)
    watch.look(0)
    assert watch.look(60 * MS)
    assert wire.sent[-1]["u"]["force"] == pytest.approx(u)


def test_a_command_that_is_not_valid_is_at_the_level_safe_whatever_the_health(wire):
    output, _ = watched(wire)
    output.send(0, (1.0,), False, 0.0, 1)
    output.send(1, (1.0,), True, 0.0, 1)
    assert [one["level"] for one in wire.sent] == ["safe", "degraded"]


def test_a_command_that_comes_while_the_watchdog_decides_is_not_overruled(wire):
    output, _ = watched(wire)
    output.send(0, (1.0,), True, 0.0, 0)
    count = output.count
    output.send(1, (2.0,), True, 0.0, 0)
    assert not output.retreat(count, 100 * MS)
    assert len(wire.sent) == 2
