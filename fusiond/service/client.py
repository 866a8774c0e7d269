"""The other end of a daemon: publish readings, follow estimates and commands, ask questions. A public API.

    from fusiond.service.client import SensorPublisher

    with SensorPublisher("minicar", "ultrasonic") as sensor:
        while True:
            sensor.publish([measure_m()])

NAME is the configuration's; its keys stand under `fusiond/NAME` unless `namespace` says otherwise.
"""

from __future__ import annotations

from fusiond.service.ask import ask
from fusiond.service.player import Player
from fusiond.service.publisher import SensorPublisher
from fusiond.service.subscribers import ControlSubscriber, EstimateSubscriber, Message, TopicSubscriber

__all__ = [
    "ControlSubscriber",
    "EstimateSubscriber",
    "Message",
    "Player",
    "SensorPublisher",
    "TopicSubscriber",
    "ask",
]
