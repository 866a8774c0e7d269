"""The command on its way out: levels, limits, fade, delay, and what the estimate is told of it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from fusiond.control.levels import Level, Safe, level_of, safe_command
from fusiond.control.saturation import left_of_fade, limited, slewed
from fusiond.engine.step import steer_on
from fusiond.numerics.kernel import interpreted
from fusiond.types import TICK, Health, Kind, Role, ServiceHealth
from tools.pages.trials import configured

SECOND = 1_000_000_000
A = np.array([[1.1269, -0.4940, 0.1129], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
B = np.array([-0.3832, 0.5919, 0.5191])


@pytest.fixture(scope="module")
def assembly():
    """The regulated reference plant with one filter and nothing watched; its tables may be changed, its step not."""
    return configured("reference_plant_lqg", {"filter": {"leave_one_out": False, "local_filters": False}})


@pytest.fixture(scope="module")
def shared(assembly):
    return assembly.engine()


@pytest.fixture(scope="module")
def tables(assembly):
    """The design as configured: engine and assembly share one array."""
    return assembly.design.copy()


@pytest.fixture
def engine(shared, tables):
    """Fresh, with the tables as configured but no fade."""
    shared._design[:] = tables
    shared._design["fade_ns"] = 0
    shared.reset()
    return shared


def tell(engine, sensor, step, value, *, ns=0):
    reading = np.zeros(1, engine.layout.reading)
    reading["sensor"] = TICK if sensor == "tick" else engine.layout.numbers[sensor]
    reading["t_ns"], reading["length"] = step * SECOND + ns, 1
    reading["z"][0, 0] = value
    return engine.process(reading)[0].copy()


def both(engine, step, value):
    """Both sensors of one step; the report of the second, which makes the command."""
    tell(engine, "y1", step, value)
    return tell(engine, "y2", step, value)


def walk(engine, steps, rng, first=1):
    return [both(engine, k, rng.normal()) for k in range(first, first + steps)]


def test_a_level_follows_from_what_the_estimate_is():
    """The table of levels.py, row by row."""
    health, forever = ServiceHealth, 10**18
    assert level_of(health.NOMINAL, True, True, 0, forever) == Level.NOMINAL
    assert level_of(health.DEGRADED, True, True, 0, forever) == Level.DEGRADED
    assert level_of(health.DEAD_RECKONING, True, True, 5, 5) == Level.DEAD_RECKONING
    assert level_of(health.DEAD_RECKONING, True, True, 6, 5) == Level.SAFE
    assert level_of(health.INVALID, True, True, 0, forever) == Level.SAFE
    assert level_of(health.NOMINAL, False, True, 0, forever) == Level.SAFE
    assert level_of(health.NOMINAL, True, False, 0, forever) == Level.SAFE


def test_a_safe_command_holds_goes_to_rest_or_on_a_straight_line():
    assert safe_command(int(Safe.HOLD), 0.7, 0.9, 0.1, 5, 10) == 0.7
    assert safe_command(int(Safe.ZERO), 0.7, 0.9, 0.1, 5, 10) == 0.1
    assert safe_command(int(Safe.RAMP), 0.7, 0.9, 0.1, 5, 10) == pytest.approx(0.5)
    assert safe_command(int(Safe.RAMP), 0.7, 0.9, 0.1, 10, 10) == 0.1


@pytest.mark.parametrize(("estimated", "sound"), [(0, False), (1, True)])
def test_more_noise_is_a_doubt_only_where_it_is_not_estimated(monkeypatch, estimated, sound):
    """A sensor named noisy still counts as sound beside adaptation; one that lies, is suspect or out never does."""
    monkeypatch.setattr(steer_on, "ADAPTS", estimated)
    design = SimpleNamespace(role=[Role.UPDATE])

    def judged(health, kind):
        return interpreted(steer_on.is_sound)(design, SimpleNamespace(health=[health], fault=[kind]), 0)

    assert judged(Health.FAULTY, Kind.NOISE) is sound
    assert judged(Health.HEALTHY, Kind.NONE)
    assert not judged(Health.FAULTY, Kind.BIAS)
    assert not judged(Health.SUSPECT, Kind.NOISE)
    assert not judged(Health.EXCLUDED, Kind.NOISE)


def test_limits_slew_and_fade_are_what_they_say():
    assert (limited(3.0, -1.0, 2.0), limited(-3.0, -1.0, 2.0), limited(0.5, -1.0, 2.0)) == (2.0, -1.0, 0.5)
    assert (slewed(3.0, 1.0, 0.5), slewed(-3.0, 1.0, 0.5), slewed(1.2, 1.0, 0.5)) == (1.5, 0.5, 1.2)
    assert slewed(3.0, 1.0, np.inf) == 3.0
    assert (left_of_fade(0, 4), left_of_fade(3, 4), left_of_fade(4, 4), left_of_fade(0, 0)) == (
        1.0,
        0.25,
        0.0,
        0.0,
    )


def test_the_command_is_the_gain_times_the_estimate(engine, assembly):
    rng = np.random.default_rng(0)
    K = assembly.plan.K
    for report in walk(engine, 30, rng):
        assert report["command_due"] == 1
        assert report["command"][0] == pytest.approx(float(-(K @ report["x"])[0]), abs=1e-12)


def test_the_prediction_uses_what_was_commanded(engine):
    """x(k+1) before its readings = A x(k) + B u(k), with no acknowledgement at all."""
    rng = np.random.default_rng(1)
    for k in range(1, 20):
        report = both(engine, k, rng.normal())
        predicted = A @ report["x"] + B * report["command"][0]
        after = tell(engine, "tick", k + 1, 0.0, ns=-1)
        assert np.allclose(after["x"], predicted, atol=1e-12)


def test_a_limited_command_is_what_the_prediction_is_told(engine):
    """The applied command, not the wanted one, and at its limit exactly."""
    engine._design["lowest"], engine._design["highest"] = -0.1, 0.1
    report = both(engine, 1, 5.0)
    assert abs(report["command"][0]) == 0.1
    assert abs(engine.desk[0]["wanted"][0]) > 0.2
    after = tell(engine, "tick", 2, 0.0, ns=-1)
    assert np.allclose(after["x"], A @ report["x"] + B * report["command"][0], atol=1e-12)


def test_an_acknowledgement_takes_the_place_of_the_command(engine):
    """The actuator says 0.3: the prediction goes by that, and by the command again once it says no more."""
    report = both(engine, 1, 2.0)
    tell(engine, "applied", 1, 0.3)
    after = tell(engine, "tick", 2, 0.0, ns=-1)
    assert np.allclose(after["x"], A @ report["x"] + B * 0.3, atol=1e-12)
    for k in range(2, 6):
        report = both(engine, k, 1.0)
    after = tell(engine, "tick", 6, 0.0, ns=-1)
    assert np.allclose(after["x"], A @ report["x"] + B * report["command"][0], atol=1e-12)


def test_acknowledging_every_command_gives_the_bits_of_acknowledging_none(engine):
    """What the engine takes for granted is what an honest actuator would say."""

    def run(acknowledging):
        engine.reset()
        rng = np.random.default_rng(5)
        for k in range(1, 25):
            report = both(engine, k, rng.normal())
            if acknowledging:
                tell(engine, "applied", k, report["command"][0])
        return engine.track["x"][0, 0].tobytes(), engine.track["d"].tobytes()

    assert run(False) == run(True)


def test_a_late_reading_is_replayed_with_the_commands_around_it(engine):
    """y2 of step 9 comes after step 10: its correction, and the commands given since, are all in the state."""
    rng = np.random.default_rng(6)
    walk(engine, 8, rng)
    first = tell(engine, "y1", 9, 1.0)
    tell(engine, "tick", 9, 0.0, ns=600_000_000)
    nine = engine.desk[0]["command"][0].copy()
    tell(engine, "y1", 10, 0.5)
    late = tell(engine, "y2", 9, -1.0)
    assert late["command_due"] == 0
    # by hand: the state of step 9 without y2, corrected by it, moved by the command of then, corrected by y1 of 10
    assert first["command_due"] == 0
    engine.reset()
    rng = np.random.default_rng(6)
    walk(engine, 8, rng)
    tell(engine, "y1", 9, 1.0)
    tell(engine, "y2", 9, -1.0)
    tell(engine, "applied", 9, nine)
    apart = tell(engine, "y1", 10, 0.5)
    assert apart["command_due"] == 0
    assert np.allclose(apart["x"], late["x"], atol=1e-12)


def test_a_due_command_waits_for_its_readings_but_not_for_one_that_missed_its_turn(engine):
    walk(engine, 3, np.random.default_rng(0))
    assert tell(engine, "y1", 4, 0.0)["command_due"] == 0
    assert tell(engine, "y2", 4, 0.0)["command_due"] == 1
    # y2 falls silent: once it is waited for, half a period; then no more
    assert tell(engine, "y1", 5, 0.0)["command_due"] == 0
    assert tell(engine, "tick", 5, 0.0, ns=400_000_000)["command_due"] == 0
    assert tell(engine, "tick", 5, 0.0, ns=500_000_000)["command_due"] == 1
    assert tell(engine, "y1", 6, 0.0)["command_due"] == 1
    assert tell(engine, "y1", 7, 0.0)["command_due"] == 1


def test_without_an_estimate_the_safe_command_goes_out(engine):
    """Ten steps without a reading: not valid, zero as configured; the prediction knows that too."""
    walk(engine, 5, np.random.default_rng(2))
    engine._design["safe_command"] = 0.25
    reckoning = tell(engine, "tick", 10, 0.0)
    assert (reckoning["service"], reckoning["command_valid"]) == (ServiceHealth.DEAD_RECKONING, 1)
    lost = tell(engine, "tick", 16, 0.0)
    assert (lost["command_due"], lost["command_valid"], lost["command"][0]) == (1, 0, 0.25)
    assert engine.track["u"][0, 0] == 0.25


def test_dead_reckoning_commands_for_no_longer_than_it_may(engine):
    engine._design["reckoning_ns"] = 2 * SECOND
    walk(engine, 5, np.random.default_rng(2))
    told = [tell(engine, "tick", k, 0.0) for k in range(6, 13)]
    valid = [int(one["command_valid"]) for one in told if one["command_due"]]
    # the tick of step 6 waits for readings; until 8 the last ones count, at 9 and 10 it is dead reckoning
    assert valid == [1, 1, 1, 1, 0, 0]


def test_an_estimate_that_knows_too_little_commands_nothing(engine):
    engine._design["largest_std"][0, 0] = 0.9
    report = both(engine, 1, 0.0)
    assert (report["std"][0] < 0.9, report["command_valid"]) == (True, 1)
    after = [tell(engine, "tick", k, 0.0) for k in (2, 3)]
    assert [int(one["command_valid"]) for one in after] == [int(one["std"][0] <= 0.9) for one in after]
    assert after[-1]["command_valid"] == 0


def test_a_sensor_that_goes_makes_no_bump(engine):
    """With a fade, the first command after the loss is the last one before; without, it jumps."""

    def jump(fade_ns):
        engine.reset()
        engine._design["fade_ns"] = fade_ns
        engine._design["silence_ns"][0, engine.layout.numbers["y1"]] = SECOND
        rng, before = np.random.default_rng(8), 0.0
        for k in range(1, 20):
            before = both(engine, k, rng.normal(0.0, 3.0))["command"][0]
        commands = [tell(engine, "y2", k, 4.0) for k in range(20, 26)]
        given = [one["command"][0] for one in commands if one["command_due"]]
        silent = next(k for k, one in enumerate(commands) if one["service"] == ServiceHealth.DEGRADED)
        previous = [before, *given][silent - 1] if silent else before
        return abs(commands[silent]["command"][0] - previous), given[-1]

    faded, at_end = jump(3 * SECOND)
    bare, bare_end = jump(0)
    assert faded < 1e-12
    assert bare > 0.05
    assert at_end == pytest.approx(bare_end, abs=1.0)


def test_no_command_moves_faster_than_the_actuator(engine):
    engine._design["slew"] = 0.2
    given = [both(engine, k, 5.0 * (-1.0) ** k)["command"][0] for k in range(1, 12)]
    assert max(np.abs(np.diff(given))) == pytest.approx(0.2, abs=1e-12)


@pytest.mark.parametrize("delay", [1, 2, 3])
def test_a_late_command_waits_in_the_queue(shared, delay):
    """u(k) drives the prediction from k + delay on; the law knows what is under way."""
    late = configured(
        "reference_plant_lqg",
        {
            "filter": {"leave_one_out": False, "local_filters": False},
            "control": {"delay_s": float(delay), "fade_s": 0.0},
        },
    )
    assert late.layout.desk == shared.layout.desk
    shared._design[:] = late.design
    shared.reset()
    rng, given = np.random.default_rng(4), []
    for k in range(1, 15):
        report = both(shared, k, rng.normal())
        queue = np.array([0.0] * delay + given)[-delay:]
        wanted = -float((late.plan.K @ np.concatenate([report["x"], queue]))[0])
        assert report["command"][0] == pytest.approx(wanted, abs=1e-12)
        acting = queue[0]
        after = tell(shared, "tick", k + 1, 0.0, ns=-1)
        assert np.allclose(after["x"], A @ report["x"] + B * acting, atol=1e-12)
        given.append(float(report["command"][0]))


def test_the_running_cost_is_the_mean_of_what_was_paid(engine, assembly):
    rng = np.random.default_rng(9)
    paid = [r["x"][0] ** 2 + 0.1 * r["command"][0] ** 2 for r in walk(engine, 40, rng)]
    assert engine.desk[0]["cost"] == pytest.approx(np.mean(paid), rel=1e-9)
    assert engine.desk[0]["cost_count"] == 40


def test_applied_is_an_input_where_the_command_drives_the_model(assembly):
    assert assembly.layout.sensor("applied").role is Role.INPUT
    assert assembly.layout.sensor("reference") is None
