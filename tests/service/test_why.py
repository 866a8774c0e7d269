"""What the daemon remembers of its decisions, and tells when asked why."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.service.admin import Refusal
from fusiond.service.ask import Refused
from fusiond.service.client import Player, TopicSubscriber, ask
from fusiond.service.health_watch import HealthWatch
from fusiond.service.report_ring import BEFORE, DEPTH, TURNS, ReportRing
from fusiond.service.why import why
from fusiond.types import Health, Kind, Verdict

MS = 1_000_000


class Told:
    """A ring told of reports as the daemon tells it."""

    def __init__(self, layout):
        self.layout, self.watch, self.ring = layout, HealthWatch(layout), ReportRing(layout)

    def tell(self, reports, *, block=1):
        for first in range(0, len(reports), block):
            part = reports[first : first + block]
            self.ring.note(part, self.watch.observe(part))

    def why(self, **asked):
        return why(self.ring, self.layout, asked)


@pytest.fixture
def told(assembly):
    return Told(assembly.layout)


@pytest.fixture
def reports(assembly):
    """Three seconds: 1000 reports of the accelerometer a second, and 20 of the ultrasonic, excluded from 1 s on."""
    layout = assembly.layout
    fast, slow = layout.numbers["accelerometer"], layout.numbers["ultrasonic"]
    reports = np.zeros(3060, layout.report)
    reports["sensor"] = fast
    reports["sensor"][50::51] = slow
    reports["t_ns"] = reports["state_t_ns"] = np.arange(3060) * 1_000_000_000 // 1020
    reports["arrival_ns"] = reports["t_ns"] + 2 * MS
    mine = reports["sensor"] == slow
    reports["dof"][mine], reports["length"][mine] = 1, 1
    reports["nu"][mine, 0], reports["S"][mine, 0], reports["nis"][mine] = 0.3, 0.01, 9.0
    reports["limit"], reports["R_used"][mine, 0], reports["R_declared"][mine, 0] = np.inf, 0.002, 0.001
    bad = np.arange(3060) >= 1070
    reports["health"][bad, slow], reports["fault"][bad, slow] = Health.EXCLUDED, Kind.BIAS
    reports["fault_size"][bad, slow], reports["fault_std"][bad, slow] = 0.5, 0.01
    reports["fault_onset_ns"][bad, slow] = 900 * MS
    reports["verdict"][bad & mine] = Verdict.EXCLUDED
    return reports


@pytest.mark.parametrize("block", [1, 7, 3060])
def test_the_turn_and_what_led_to_it_outlive_thousands_of_readings(told, reports, block):
    """However readings come in batches: the reading that excluded the sensor, and those before and after it."""
    told.tell(reports, block=block)
    answer = told.why(sensor="ultrasonic", at=1070 / 1020, last=4)
    (turn,) = answer["turns"]
    assert (turn["to"], turn["fault"]["kind"], turn["fault"]["size"]) == ("excluded", "bias", 0.5)
    assert turn["t_s"] == pytest.approx(1070 / 1020, abs=1e-6)
    assert [r["verdict"] for r in answer["readings"]] == ["used", "excluded", "excluded", "excluded"]
    assert answer["readings"][0]["fault"] is None


def test_a_decision_has_everything_it_was_made_of(told, reports):
    told.tell(reports)
    reading = told.why(sensor="ultrasonic")["readings"][-1]
    assert reading.pop("fault")["onset_s"] == 0.9
    assert reading == {
        "t_s": reports["t_ns"][-1] / 1e9, "delay_s": 0.002, "z": [0.0], "nu": [0.3], "S": [0.01], "nis": 9.0,
        "dof": 1, "limit": None, "R_used": [0.002], "R_declared": [0.001], "verdict": "excluded",
        "health": "excluded", "action": "none",
    }  # fmt: skip


def test_what_is_kept_is_bounded(told, reports):
    """A sensor that turns for ever, and a fast one beside it: rings, turns and what led to them have limits."""
    flapping = np.concatenate([reports[1100:1151]] * 300)
    number = told.layout.numbers["ultrasonic"]
    flapping["health"][::2, number] = Health.HEALTHY
    told.tell(flapping)
    assert len(told.ring.turns(number)) == TURNS
    assert len(told.ring.reports(told.layout.numbers["accelerometer"])) <= DEPTH + TURNS * (BEFORE + 8)
    assert len(told.why(sensor="ultrasonic", last=500)["readings"]) <= 500


def test_before_anything_came_there_is_nothing_to_tell(told):
    answer = told.why(sensor="ultrasonic", at="3.5")
    assert (answer["readings"], answer["turns"], answer["covers_s"]) == ([], [], None)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"sensor": "ultrasonics"}, "ask about one of accelerometer, applied, reference, ultrasonic"),
        ({}, "no sensor of that name"),
        ({"sensor": "ultrasonic", "last": 0}, "limits 1 to 500"),
        ({"sensor": "ultrasonic", "at": "noon"}, "no number"),
        ({"sensor": "ultrasonic", "at": float("nan")}, "no number"),
        ({"sensor": "ultrasonic", "last": [3]}, "no number"),
    ],
)
def test_a_question_that_means_nothing_is_refused(told, asked, message):
    with pytest.raises(Refusal, match=message):
        told.why(**asked)


def test_a_change_of_the_fault_alone_is_a_transition_too(told, reports):
    """The size is revised while the sensor stays excluded: from excluded to excluded, with another fault."""
    number = told.layout.numbers["ultrasonic"]
    revised = reports[1200:1203].copy()
    revised["fault_size"][2, number] = 0.7
    revised["model"][1] = 1
    changes = told.watch.observe(revised)
    assert [(c.sensor, c.before, c.after, c.fault and c.fault["size"], c.model) for c in changes] == [
        ("ultrasonic", "healthy", "excluded", 0.5, False),
        (None, "invalid", "nominal", None, False),
        (None, "nominal", "nominal", None, True),
        ("ultrasonic", "excluded", "excluded", 0.7, False),
        (None, "nominal", "nominal", None, False),
    ]


def test_a_daemon_tells_of_a_fault_and_why(start, assembly):
    """A range finder that turns to NaN: an event with the fault, health with it, and why with the readings refused."""
    layout = assembly.layout
    daemon = start(extra="[faults]\nmean_time_between_false_alarms_s = 36000.0\n")
    readings = np.zeros(240, layout.reading)
    for k, reading in enumerate(readings):
        is_range = k % 3 == 2
        reading["sensor"] = layout.numbers["ultrasonic" if is_range else "accelerometer"]
        reading["t_ns"] = 10**9 + (k // 3) * 20 * MS + (k % 3) * 10 * MS - is_range * 5 * MS
        reading["z"][0] = (
            (np.nan if k >= 180 else 1.0 + 0.01 * np.sin(k * k)) if is_range else 0.01 * np.sin(k * k)
        )
        reading["length"] = 1
    with (
        TopicSubscriber("bench", "event", daemon.endpoint) as events,
        TopicSubscriber("bench", "health", daemon.endpoint) as health,
        Player("bench", layout, daemon.endpoint, speed=float("inf"), most_hz=500.0) as player,
    ):
        player.wait_until_heard()
        player.play(readings)
        status = daemon.status_when(lambda now: now["sensors"]["ultrasonic"]["fault"] is not None)
        assert status["sensors"]["ultrasonic"]["fault"]["kind"] in ("garbage", "silent")
        while (event := events.next(20.0))["sensor"] != "ultrasonic":
            pass
        assert (event["from"], event["fault"]["kind"]) == ("healthy", "garbage")
        while not (message := health.next(20.0))["faults"]:
            pass
        assert message["faults"]["ultrasonic"]["kind"] in ("garbage", "silent")
        answer = ask("bench", "why", daemon.endpoint, fields={"sensor": "ultrasonic", "at": event["t"]})
        assert "non_finite" in {reading["verdict"] for reading in answer["readings"]}
        assert answer["turns"][0]["fault"]["kind"] == "garbage"
        with pytest.raises(Refused, match="no sensor of that name"):
            ask("bench", "why", daemon.endpoint, fields={"sensor": "sonar"})
