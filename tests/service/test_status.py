"""What a running daemon's `status` says of sensors that never spoke."""

from __future__ import annotations

from fusiond.service.client import SensorPublisher


def test_a_sensor_nobody_ever_heard_is_not_called_healthy(start):
    """Silent from the start on, whatever the deadline; what the state does not need is only said to be unheard."""
    daemon = start()
    sensors = daemon.status()["sensors"]
    assert {name: (sensor["heard"], sensor["health"]) for name, sensor in sensors.items()} == {
        "accelerometer": (False, "silent"),
        "applied": (False, "healthy"),
        "reference": (False, "healthy"),
        "ultrasonic": (False, "silent"),
    }
    with SensorPublisher("bench", "ultrasonic", daemon.endpoint) as sensor:
        sensor.wait_until_heard()
        sensor.publish([0.1])
        status = daemon.status_when(lambda status: status["readings"] == 1)
    assert status["sensors"]["ultrasonic"]["heard"]
    assert status["sensors"]["ultrasonic"]["health"] == "healthy"
    assert status["sensors"]["accelerometer"]["health"] == "silent"


def test_a_reading_that_was_refused_was_heard(start):
    daemon = start()
    with SensorPublisher("bench", "ultrasonic", daemon.endpoint) as sensor:
        sensor.wait_until_heard()
        sensor.publish([1e6])
        status = daemon.status_when(lambda status: status["readings"] == 1)
    assert status["sensors"]["ultrasonic"]["verdicts"] == {"out_of_range": 1}
    assert status["sensors"]["ultrasonic"]["heard"]
