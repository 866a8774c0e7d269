"""Sensors that are off, frozen, or there only now and then; and inputs that lie."""

from __future__ import annotations

import numpy as np
import pytest

from fusiond.types import Health, Kind, ServiceHealth
from tests.scenarios.faults.drive import lasting, scene


def flips(run, sensor, start_s, end_s):
    """How often the sensor's health changed in an interval."""
    return sum(start_s <= turn.at_s < end_s for turn in run.turns(sensor))


def test_an_outage_is_flagged_grows_invalid_and_ends():
    """No ultrasonic: silent in 0.1 s, dead reckoning at 1 s, invalid at 5 s, well 10 s after its return (F3, F10)."""
    run = scene("minicar").drive(40.0, ["ultrasonic.broken@10+11"])
    assert run.named("ultrasonic").kind is Kind.SILENT
    assert run.named("ultrasonic").at_s <= 10.1
    for health, at_s in ((ServiceHealth.DEAD_RECKONING, 11.0), (ServiceHealth.INVALID, 15.0)):
        first = run.t_s[np.flatnonzero(run.reports["service"] == health)[0]]
        assert first == pytest.approx(at_s, abs=0.05)
    assert run.service(31.0) == {ServiceHealth.NOMINAL}
    assert run.worst("position", 22.0) < 0.05
    assert not run.blamed("accelerometer")


def test_after_25_s_without_fixes_the_position_is_back_in_ten():
    """GPS off for 25 s, wheels and gyro left: within 2 m from 10 s after its return on, and healthy (F3)."""
    run = scene("plane").drive(60.0, ["gps.broken@10+25"])
    assert run.named("gps").kind is Kind.SILENT
    assert run.named("gps").at_s <= 11.0
    assert run.worst("x", 45.0) < 2.0
    assert run.worst("y", 45.0) < 2.0
    assert run.last("gps").health is Health.HEALTHY


@pytest.mark.parametrize(
    ("name", "seconds", "fault", "start_s", "end_s"),
    [
        ("minicar", 30.0, "ultrasonic.intermittent=0.1@10+5", 10.0, 15.0),
        ("three_positions", 60.0, "y2.intermittent=0.1@30+10", 30.0, 40.0),
        ("reference_plant", 300.0, "y2.intermittent=0.1@150+60", 150.0, 210.0),
        ("plane", 40.0, "gps.intermittent=0.1@10+10", 10.0, 20.0),
    ],
)
def test_a_sensor_that_is_there_a_tenth_of_the_time_does_not_flap(name, seconds, fault, start_s, end_s):
    """10 % of the readings arrive: one flag, up for the whole time, down once afterwards (F5)."""
    run, sensor = scene(name).drive(seconds, [fault]), fault.split(".")[0]
    assert flips(run, sensor, start_s, end_s) == 1, run.story()
    assert flips(run, sensor, end_s, seconds) == 1
    assert run.last(sensor).health is Health.HEALTHY


def test_bad_for_1_8_s_and_good_for_0_2_s_stays_off():
    """Four rounds of 1.8 s bad, 0.2 s good: out during all of them, no return in between (F5)."""
    rounds = [f"y2.bias=2@{30 + 2 * k}+1.8" for k in range(4)]
    run = scene("three_positions").drive(60.0, rounds)
    assert run.named("y2").at_s <= 30.3
    rows = (run.t_s > run.named("y2").at_s) & (run.t_s < 37.8)
    assert Health.HEALTHY not in {Health(int(h)) for h in np.unique(run.health("y2")[rows])}, run.story()
    assert run.last("y2").health is Health.HEALTHY


@pytest.mark.parametrize(
    ("name", "seconds", "fault", "by_s", "well_s"),
    [
        ("minicar", 30.0, "ultrasonic.stuck@10+5", 10.1, 25.0),
        ("plane", 40.0, "gyro.stuck@15+3", 15.1, 28.0),
        ("plane", 40.0, "gps.stuck@15+3", 15.5, 40.0),
        ("three_positions", 60.0, "y2.stuck@30+10", 30.3, 50.0),
        ("reference_plant", 300.0, "y2.stuck@150+30", 152.0, 240.0),
    ],
)
def test_a_frozen_sensor_is_out_after_three_equal_values_and_returns(name, seconds, fault, by_s, well_s):
    """Equal values while everything moves: excluded at the third at the latest, back when they change again (F6)."""
    run, sensor = scene(name).drive(seconds, [fault]), fault.split(".")[0]
    assert run.named(sensor).health is Health.EXCLUDED, run.story()
    assert run.named(sensor).at_s <= by_s, run.story()
    assert run.last(sensor).health is Health.HEALTHY
    assert max(turn.at_s for turn in run.turns(sensor)) <= well_s


@pytest.mark.parametrize("fault", ["bias=-5@10", "bias=9.81@10"])
def test_an_accelerometer_off_by_5_m_s2_or_1_g_is_out_in_half_a_second(fault):
    """Excluded within 0.5 s, the ultrasonic not blamed (F7)."""
    run = scene("minicar").drive(30.0, [f"accelerometer.{fault}"])
    assert run.named("accelerometer").at_s <= 10.5
    assert run.named("accelerometer").health is Health.EXCLUDED
    assert run.named("accelerometer").kind is Kind.BIAS
    assert not run.blamed("ultrasonic"), run.story()


@pytest.mark.parametrize("fault", ["broken@10", "stuck@10", "bias=0.5@10", "nan@10"])
def test_the_car_goes_on_without_its_accelerometer(fault):
    """Broken, frozen, no number, biased by 0.5 m/s^2: named in 0.6 s, degraded, 10 cm kept for 50 s (F7, F10)."""
    run = scene("minicar").drive(60.0, [f"accelerometer.{fault}"])
    assert run.named("accelerometer").at_s <= 10.6, run.story()
    assert not run.blamed("ultrasonic"), run.story()
    assert run.worst("position", 11.0) < 0.1
    assert run.rmse("position", 12.0) < 0.02
    assert ServiceHealth.INVALID not in run.service(10.1)


@pytest.mark.parametrize(("lasts_s", "tried_s"), [(8.0, (20.0, 21.0)), (50.0, None)])
def test_an_excluded_accelerometer_is_tried_when_it_reads_like_one_that_has_healed(lasts_s, tried_s):
    """Off by 0.5 m/s^2 for 8 s or for good: on probation at its next turn after the end, or never in 50 s."""
    run = scene("minicar").drive(60.0, [f"accelerometer.bias=0.5@10+{lasts_s}"])
    at_s = run.when("accelerometer", Health.PROBATION)
    assert at_s == np.inf if tried_s is None else tried_s[0] <= at_s <= tried_s[1], run.story()
    assert tried_s is None or run.last("accelerometer").health is Health.HEALTHY


def test_a_wrong_cluster_after_an_outage_captures_nobody():
    """y2 is gone for 10 s and comes back 8 m off, consistent with itself: named, and the position holds (F4)."""
    run = scene("three_positions").drive(60.0, ["y2.broken@20+10", "y2.bias=8@30+10"])
    kinds = {turn.kind for turn in run.turns("y2") if turn.health is Health.EXCLUDED}
    assert Kind.BIAS in kinds, run.story()
    assert run.worst("position", 20.0) < 0.5


def test_a_second_publisher_at_the_origin_is_not_believed():
    """Every second reading of y2 is zero, from a source that stands elsewhere: out, and the position holds (F15)."""

    def change(log, layout):
        rows = np.flatnonzero((log["sensor"] == layout.numbers["y2"]) & (log["t_ns"] > lasting(30.0)))
        log["z"][rows[::2], 0] = 0.0
        return log

    clean, run = scene("three_positions").drive(60.0), scene("three_positions").drive(60.0, change=change)
    assert abs(clean.value("position")[-1]) > 20.0
    assert run.blamed("y2"), run.story()
    assert not run.blamed("y1"), run.story()
    assert not run.blamed("y3"), run.story()
    assert run.worst("position", 30.0) < 0.5


@pytest.mark.parametrize(("fault", "within_m"), [("gps.bias=60@15+8", 5.0), ("gps.0.bias=20@15", 1.0)])
def test_a_gps_step_is_taken_off(fault, within_m):
    """+60 m for 8 s: less than 5 m; +20 m for good: less than 1 m; wheels and gyro are not blamed (F1)."""
    run = scene("plane").drive(40.0, [fault])
    assert run.named("gps").kind is Kind.BIAS
    assert run.named("gps").at_s <= 15.5
    assert run.worst("x", 14.0) < within_m
    assert run.worst("y", 14.0) < within_m
    assert not run.blamed("wheel_speed"), run.story()
    assert not run.blamed("gyro"), run.story()


def test_a_gyro_off_by_one_radian_a_second_is_named_in_half_a_second():
    """+1 rad/s: named within 0.5 s by its size, yaw kept to 0.05 rad, healthy 0.1 s after it ends (F8)."""
    run = scene("plane").drive(40.0, ["gyro.bias=1@15+3"])
    assert run.named("gyro").at_s <= 15.5
    assert run.named("gyro").size == pytest.approx(1.0, abs=0.05)
    assert run.worst("yaw", 15.0) < 0.05
    assert run.when("gyro", Health.HEALTHY, 16.0) <= 18.1
    assert not run.blamed("gps")
    assert not run.blamed("wheel_speed")


def test_a_noisy_gps_is_weighed_down():
    """Ten times its noise from 15 s: named within 2 s as noise; the position stays within 3 m (F2)."""
    run = scene("plane").drive(40.0, ["gps.noise=10@15"])
    assert run.named("gps").at_s <= 17.0, run.story()
    assert run.named("gps").kind is Kind.NOISE
    assert run.worst("x", 15.0) < 3.0
    assert run.worst("y", 15.0) < 3.0


def test_a_robot_that_knows_its_speed_alone_goes_as_far_as_it_said():
    """60 s at 5 m/s from wheels and gyro, no fix: the distance within 1 %, and no sensor is blamed (F20)."""
    stage = scene("plane")
    log = stage.clean(60.0, 0)
    log = log[log["sensor"] != stage.layout.numbers["gps"]]
    wheels = log["sensor"] == stage.layout.numbers["wheel_speed"]
    noise = np.random.default_rng(5).standard_normal(len(log))
    log["z"][:, 0] = np.where(wheels, 5.0 + 0.1 * noise, 0.01 * noise)
    stage.engine.reset()
    reports = stage.engine.process(log).copy()
    settled = reports["t_ns"] >= lasting(5.0)
    x, y = reports["x"][settled, 0], reports["x"][settled, 1]
    assert np.hypot(x[-1] - x[0], y[-1] - y[0]) == pytest.approx(275.0, rel=0.01)
    known = [stage.layout.numbers[name] for name in ("wheel_speed", "gyro")]
    assert not reports["health"][settled][:, known].any()
