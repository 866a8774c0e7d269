"""Local filters beside the centralized one: what they publish, and what their parity is worth."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.stats import chi2

from fusiond.assembly.assembly import load
from fusiond.engine.parity import local_estimate
from fusiond.service.client import SensorPublisher, TopicSubscriber

WAIT_S = 20.0
RUNS, STEPS = 400, 12
LASER = """
[sensor.laser]
kind = "direct"
slots = ["position"]
rate_hz = 50.0
noise_std = { position_m = 0.03 }
"""
PAIR = """
name = "pair"
[model]
kind = "linear"
step_s = 0.1
states = ["position", "velocity"]
A = [[1.0, 0.1], [0.0, 1.0]]
G = [[0.005], [0.1]]
Q = [[1.0]]
[initial]
state = { position = 0.0, velocity = 0.0 }
std = { position = 1.0, velocity = 1.0 }
[sensor.near]
kind = "linear"
H = [[1.0, 0.0]]
channels = ["y"]
noise_std = { y = 0.1 }
[sensor.far]
kind = "linear"
H = [[1.0, 0.0]]
channels = ["y"]
noise_std = { y = 0.4 }
"""


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    path = tmp_path_factory.mktemp("pair") / "pair.toml"
    path.write_text(PAIR, encoding="utf-8")
    return load(path)


def drive(layout, rng):
    """Readings of both sensors along one random motion of the configuration's own model."""
    readings = np.zeros(2 * STEPS, layout.reading)
    x = rng.normal(0.0, 1.0, 2)
    for k in range(STEPS):
        for i, (name, std) in enumerate((("near", 0.1), ("far", 0.4))):
            reading = readings[2 * k + i]
            reading["sensor"], reading["length"], reading["t_ns"] = (
                layout.numbers[name],
                1,
                k * 100_000_000,
            )
            reading["z"][0] = x[0] + rng.normal(0.0, std)
        x = np.array([[1.0, 0.1], [0.0, 1.0]]) @ x + np.array([0.005, 0.1]) * rng.normal()
    return readings


def row_of(layout, name):
    return next(i for i, one in enumerate(layout.filters) if one.hears == "only" and one.sensor == name)


@pytest.mark.parametrize("name", ["near", "far"])
def test_the_parity_is_as_large_as_its_deviation_says(pair, name):
    """Over independent runs the squared parity over its variance is chi-square distributed, seen from both sides."""
    engine, rng, row = pair.engine(), np.random.default_rng(0), row_of(pair.layout, name)
    squares = np.zeros(2)
    for _ in range(RUNS):
        engine.reset()
        engine.process(drive(pair.layout, rng))
        local = local_estimate(engine, row)
        assert not local.bounded.any()
        squares += (local.parity / local.parity_std) ** 2
    low, high = chi2.ppf([0.0005, 0.9995], RUNS)
    assert ((low < squares) & (squares < high)).all(), squares / RUNS


def test_a_parity_between_two_times_is_none(pair):
    engine = pair.engine()
    readings = drive(pair.layout, np.random.default_rng(0))
    engine.process(readings[: 2 * STEPS - 1])
    assert local_estimate(engine, row_of(pair.layout, "near")).parity is not None
    assert local_estimate(engine, row_of(pair.layout, "far")).parity is None


def test_where_the_difference_is_no_variance_the_bound_stands(pair):
    """Before the first reading both filters know the same: no difference, so the bound, by name."""
    engine = pair.engine()
    engine.process(drive(pair.layout, np.random.default_rng(0))[:2])
    local = local_estimate(engine, row_of(pair.layout, "near"))
    velocity = 1
    assert local.bounded.tolist() == [False, True]
    assert local.parity_std[velocity] == pytest.approx(2.0 * local.std[velocity])


def test_a_local_filter_goes_out_where_somebody_listens_and_its_parity_shows_in_status(start):
    """Two sensors that disagree by 0.5 m: the local filters stand either side of the estimate."""
    daemon = start(extra=LASER)
    with (
        TopicSubscriber("bench", "local/laser", daemon.endpoint) as locals_,
        SensorPublisher("bench", "ultrasonic", daemon.endpoint) as ultrasonic,
        SensorPublisher("bench", "laser", daemon.endpoint) as laser,
    ):
        ultrasonic.wait_until_heard()
        laser.wait_until_heard()
        t_ns, message, deadline = 10**18, None, time.monotonic() + WAIT_S
        while message is None and time.monotonic() < deadline:
            t_ns += 20_000_000
            ultrasonic.publish([1.0], t_ns)
            laser.publish([1.5], t_ns + 1_000_000)
            message = locals_.next(0.1)
        assert set(message.content) == {
            "t", "t_ns", "seq", "epoch", "state", "std", "parity", "parity_std", "bounded"
        }  # fmt: skip
        assert message["seq"] == 1
        assert message["state"]["position"] == pytest.approx(1.5, abs=0.05)
        assert message["parity"]["position"] > 5.0 * message["parity_std"]["position"]
        found = daemon.status()
        assert found["epoch"] == message["epoch"]
        assert set(found["parity"]) == {"laser", "ultrasonic"}
        assert found["parity"]["laser"]["parity"]["position"] > 0.1


def test_nobody_pays_for_local_filters_nobody_has(start):
    daemon = start()
    assert daemon.status()["parity"] == {}
