"""Spikes and bursts of an input: named by its own odd readings, taken out, and over when they are."""

from __future__ import annotations

import pytest

from fusiond.types import Health, Kind, ServiceHealth
from tests.scenarios.faults.drive import scene


@pytest.mark.parametrize("size", [1.0, 10.0, 100.0])
@pytest.mark.parametrize("seed", [0, 1])
def test_one_bad_sample_of_the_accelerometer_changes_no_flag(size, seed):
    """A millisecond of 100 m/s2 is 0.1 m/s of error at once: nobody is blamed, the position stays within 5 cm."""
    run = scene("minicar").drive(25.0, [f"accelerometer.spike={size}@10"], seed)
    assert not run.blamed("accelerometer"), run.story()
    assert not run.blamed("ultrasonic"), run.story()
    assert run.worst("position", 9.9) < 0.05


@pytest.mark.parametrize("fault", ["accelerometer.spike=100@10+0.01", "accelerometer.spike=3@10+0.1"])
def test_ten_bad_samples_of_the_accelerometer_do_and_the_ultrasonic_is_believed(fault):
    """Ten or a hundred in a row: the accelerometer, a spike, in 0.3 s; within 0.1 m; healthy again in 5 s."""
    run = scene("minicar").drive(25.0, [fault])
    verdict = run.named("accelerometer")
    assert verdict.kind is Kind.SPIKE, run.story()
    assert verdict.at_s <= 10.3
    assert not run.blamed("ultrasonic"), run.story()
    assert run.worst("position", 9.9) < 0.1
    assert run.when("accelerometer", Health.HEALTHY, verdict.at_s) <= 15.0


def test_a_drift_of_the_ultrasonic_is_not_taken_for_a_burst_that_no_reading_shows():
    """0.3 m/s looks like a burst of the accelerometer; without an odd reading of it the ultrasonic is named."""
    run = scene("minicar").drive(25.0, ["ultrasonic.drift=0.3@10"])
    assert run.named("ultrasonic").kind is Kind.DRIFT, run.story()
    assert not run.blamed("accelerometer")


@pytest.mark.parametrize(
    ("fault", "kind", "within_s"),
    [("broken", Kind.SILENT, 0.1), ("stuck", Kind.STUCK, 0.1), ("bias=0.5", Kind.BIAS, 1.0)],
)
def test_a_car_without_its_accelerometer_is_degraded_on_the_ultrasonic_alone(fault, kind, within_s):
    """Broken, stuck or off by 0.5 m/s2 from 10 s on: named, degraded, within 0.2 m till 15 s."""
    run = scene("minicar").drive(25.0, [f"accelerometer.{fault}@10"])
    verdict = run.named("accelerometer")
    assert verdict.kind is kind, run.story()
    assert verdict.at_s <= 10.0 + within_s
    assert not run.blamed("ultrasonic"), run.story()
    assert run.service(verdict.at_s + 0.1, 15.0) == {ServiceHealth.DEGRADED}
    assert run.worst("position", 9.9, 15.0) < 0.2
